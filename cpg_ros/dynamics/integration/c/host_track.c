
/* A network is off its orbit if, for more than MAX_STRIDES strides, a cell is further away than
 * the fraction ORBIT_DISTANCE of the peak, or the phase differs from the clock by more than
 * MAX_PHASE_ERROR cycles. */
#define ORBIT_DISTANCE 0.3
#define MAX_PHASE_ERROR 0.15
#define MAX_STRIDES 0.5

/* Read joints and legs off a track, a number of strides after the last time. */
void cpg_track_look(cpg_track *t, cpg_real strides)
{
    t->distance = t->sum = 0.0;
    (t->gait->by_phase ? look_phases : look_waveform)(t, strides);
    t->distance += 0.0 * t->sum;
}

/* A network gets some strides to find its gait. Return whether it came to rest instead. */
static uint8_t settle(cpg_track *t, cpg_real strides)
{
    const cpg_gait *gait = t->gait;
    /* It has settled after a whole stride on the orbit: a small state may look so at times. */
    t->calm = t->distance < ORBIT_DISTANCE / 3.0 ? t->calm + strides : 0.0;
    t->settling = t->calm > 1.0 ? 0.0 : t->settling - strides;
    cpg_real moving = 0.0;
    for (int16_t i = 0; i < gait->components; i++) {
        moving = most(moving, fabs(t->net.now[gait->components + i]));
    }
    t->still = moving * gait->period < gait->least ? t->still + strides : 0.0;
    t->phase = t->legs[0];
    t->phase_carry = 0.0;
    return t->still > 1.0;
}

/* Advance by some strides; return whether the network is still on its orbit. */
static uint8_t move(cpg_track *t, cpg_real strides)
{
    t->advance(t->net.lane, t->net.clock, strides * t->gait->period, t->net.now);
    cpg_track_look(t, strides);
    const cpg_real expected = t->phase + strides;
    if (!(t->distance - t->distance == 0.0)) {
        t->phase = fraction(expected);
        return 0;
    }
    const cpg_real error = fraction(t->legs[0] - expected + 0.5) - 0.5;
    /* The clock follows the network's own phase within two strides. */
    t->phase = turned(t->phase, strides + least(1.0, 0.5 * strides) * error, &t->phase_carry);
    if (t->settling > 0.0) {
        if (settle(t, strides)) {
            t->settling = 0.0;
            t->astray = 2.0 * MAX_STRIDES;
        }
    } else if (t->distance > ORBIT_DISTANCE || fabs(error) > MAX_PHASE_ERROR) {
        t->astray += strides;
    } else {
        t->astray = 0.0;
    }
    return t->astray <= MAX_STRIDES;
}

int cpg_track_advance(cpg_track *t, cpg_real strides)
{
    return move(t, strides);
}

/* Put the track's own network on its orbit where its first leg is at a phase, cycles. */
void cpg_track_reseed(cpg_track *t, cpg_real phase)
{
    const cpg_real ahead = fraction(phase - t->gait->start);
    const size_t size = (size_t)t->seed.size * sizeof(cpg_real);
    memcpy(t->home.x, t->seed.x, size);
    memcpy(t->home.slope, t->seed.slope, size);
    memcpy(t->home.before, t->seed.before, size);
    memcpy(t->home.clock, t->seed.clock, 2 * sizeof(cpg_real));
    t->net = t->home;
    t->advance(t->net.lane, t->net.clock, ahead * t->gait->period, t->net.now);
    if (t->gait->by_phase) {
        begin_clocks(t, ahead);
    }
    cpg_track_look(t, 0.0);
    t->phase = t->legs[0];
    t->phase_carry = t->settling = t->astray = 0.0;
}

void cpg_steer(cpg_smoother *strides, cpg_real dt)
{
    approach(strides, (int16_t)strides->legs, dt);
}

static void recover(cpg *c, cpg_track *t)
{
    c->faults++;
    c->recovering = 1;
    cpg_track_reseed(t, t->phase);
    c->absorbed = 0.0;
    c->jumped = 0;
}

#undef CPG_JOINTS
#define CPG_JOINTS (c->joints)
#define cpg_offset (c->offset)
#define cpg_limits (c->limits)
