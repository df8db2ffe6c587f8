
/* ABSORB_TIME: time over which jumps are absorbed, s. */
#define ABSORB_TIME 0.3
/* MAX_STALL: longest time for which the clock runs slow after a stall, s; otherwise as long as the
 * stall. */
#define MAX_STALL 0.5

/* MIN_RAMP: least duration of a ramp or fade, s. The clock adapts from substep to substep: a joint
 * that accelerated within a single one would exceed its speed limit before the clock slows. */
#define MIN_RAMP 0.05

void cpg_ramp_to(cpg_ramp *ramp, cpg_real end, cpg_real time)
{
    ramp_to(ramp, end, most(time, MIN_RAMP));
}

/* Bring the joints from their first angles to the stand, none faster than half of its limit. */
void cpg_approach_stand(cpg *c, cpg_real time)
{
    for (int16_t joint = 0; joint < CPG_JOINTS; joint++) {
        const cpg_real left = c->approach.level * fabs(c->found[joint]);
        time = most(time, 1.5 * left / most(0.5 * c->limits[2][joint], 1e-9));
    }
    cpg_ramp_to(&c->approach, 0.0, time);
}

/* Take the requests of other threads. */
static void take(cpg *c)
{
    cpg_real go = 0.0;
    __atomic_exchange(&c->go, &go, &go, __ATOMIC_ACQ_REL);
    if (go != 0.0) {
        cpg_ramp_to(&c->ramp, go > 0.0, fabs(go));
        if (go < 0.0 && c->approach.parts > 0) {
            cpg_approach_stand(c, -go);
        }
    }
    if (c->tracks < CPG_TRACKS) {
        cpg_track *t = __atomic_load_n(&c->waiting, __ATOMIC_ACQUIRE);
        if (t) {
            t->stride = c->strides ? c->strides->now : 0;
            cpg_track_reseed(t, c->track[c->tracks - 1]->phase);
            c->track[c->tracks] = t;
            __atomic_store_n(&c->tracks, c->tracks + 1, __ATOMIC_RELEASE);
            /* Keep a request that has come meanwhile. */
            __atomic_compare_exchange_n(&c->waiting, &t, 0, 0, __ATOMIC_ACQ_REL, __ATOMIC_RELAXED);
        }
    }
}

/* Take over the wanted angles; the difference after a jump decays smoothly. */
static void absorb(cpg *c, cpg_real dt, const cpg_real *wanted, const cpg_real *rate)
{
    const uint8_t absorbing = c->absorbed < ABSORB_TIME;
    if (absorbing && c->jumped) {
        c->absorbed += dt;
    }
    const cpg_real done = least(1.0, c->absorbed / ABSORB_TIME);
    for (int16_t joint = 0; joint < CPG_JOINTS; joint++) {
        cpg_real gap = 0.0, gap_rate = 0.0;
        if (absorbing) {
            if (!c->jumped) {
                c->jump[joint] = c->wanted[joint] + dt * c->rate[joint] - wanted[joint];
                c->jump_rate[joint] = c->rate[joint] - rate[joint];
            }
            const cpg_ramp_part way = {c->jump[joint], c->jump_rate[joint], 0.0, ABSORB_TIME};
            gap = come_to_rest(&way, done, &gap_rate);
        }
        c->wanted[joint] = wanted[joint] + gap;
        c->rate[joint] = rate[joint] + gap_rate;
    }
    c->jumped = 1;
    c->recovering = c->recovering && c->absorbed < ABSORB_TIME;
}

static cpg_real pace_at(const cpg *c, cpg_real s)
{
    cpg_real rate;
    return c->stall_low + (1.0 - c->stall_low) * smoothstep(s, &rate);
}

/* Slow the clock after a stall in s: the longer the stall, the more the joints have stopped. */
void cpg_resume(cpg *c, cpg_real stall)
{
    const cpg_real pace = c->stall > 0.0 ? pace_at(c, c->stall_past / c->stall) : 1.0;
    c->stall_low = pace * most(0.0, 1.0 - stall / HOLD);
    c->stall = least(MAX_STALL, stall + c->stall - c->stall_past);
    c->stall_past = 0.0;
}

/* Return the time by which a slowed clock advances in dt, s; pace is its rate at the end. */
static cpg_real slowed_in(cpg *c, cpg_real dt, cpg_real *pace)
{
    const cpg_real time = c->stall, low = c->stall_low, before = c->stall_past / time;
    const cpg_real after = least(1.0, (c->stall_past + dt) / time);
    /* The integral of the smooth step. */
    const cpg_real risen = after * after * after * (1.0 - 0.5 * after)
                         - before * before * before * (1.0 - 0.5 * before);
    const cpg_real way = time * (low * (after - before) + (1.0 - low) * risen)
                       + most(0.0, c->stall_past + dt - time);
    c->stall_past += dt;
    *pace = pace_at(c, after);
    if (after >= 1.0) {
        c->stall = c->stall_past = 0.0;
    }
    return way;
}

/* Compute the wanted angles and rates of the joints after dt s, before any correction. */
void cpg_plan(cpg *c, cpg_real dt)
{
    cpg_real wanted[CPG_JOINTS], rate[CPG_JOINTS], clock = dt;
    take(c);
    c->fraction = 1.0;
    if (c->stall > 0.0) {
        clock = slowed_in(c, dt, &c->fraction);
    }
    move_body(c, clock);
    clock *= c->frequency_scale;
    c->fraction *= c->frequency_scale;
    if (c->tracks == 1 && c->ramp.parts == 0 && c->approach.parts == 0
            && !(c->absorbed < ABSORB_TIME)) {
        if (cruise(c, clock, c->wanted, c->rate)) {
            carry(c, c->rate);
            return;
        }
        recover(c, c->track[0]);
        part_of_tick(c, 0.0, wanted, rate);
        carry(c, rate);
        absorb(c, 0.0, wanted, rate);
    }
    const cpg_real parts = most(1.0, ceil(clock / c->substep - 1e-9));
    for (cpg_real n = 0.0; n < parts; n += 1.0) {
        part_of_tick(c, clock / parts, wanted, rate);
        carry(c, rate);
        absorb(c, clock / parts, wanted, rate);
    }
}

/* Move the joints to the wanted angles, or to the goal of a correction. */
void cpg_move(cpg *c, cpg_real dt, int corrected)
{
    cpg_real rate[CPG_JOINTS];
    for (int16_t joint = 0; joint < CPG_JOINTS; joint++) {
        rate[joint] = c->fraction * c->rate[joint];
        if (corrected) {
            const cpg_real correction = c->goal[joint] - c->wanted[joint];
            if (dt > 0.0) {
                rate[joint] += (correction - c->correction[joint]) / dt;
            }
            c->correction[joint] = correction;
        }
    }
    confine(c, dt, corrected ? c->goal : c->wanted, rate);
    c->ticks_held += c->held > 0;
    const cpg_track *newest = c->track[c->tracks - 1];
    c->legs = newest->legs;
    c->state = newest->net.now;
}

/* Want the joints where they are, at rest. */
static void rest(cpg *c)
{
    for (int16_t joint = 0; joint < CPG_JOINTS; joint++) {
        c->wanted[joint] = c->position[joint];
        c->rate[joint] = c->correction[joint] = 0.0;
    }
}

/* Move the joints to the goal, whatever the gait is; requests of other threads are taken, but only
 * the first gait runs. */
void cpg_reach(cpg *c, cpg_real dt)
{
    take(c);
    c->tracks = 1;
    rest(c);
    cpg_move(c, dt, 1);
}

/* Fill the inputs of a correction: level, phase of the first leg, fraction of the gait that is
 * entered, strides per second, whether the gait changes, roll, pitch and yaw of the body; keys of
 * both gaits, the entered last. */
void cpg_report(const cpg *c, cpg_real *numbers, int64_t *gaits)
{
    const cpg_track *newest = c->track[c->tracks - 1];
    const uint8_t fades = c->tracks > 1;
    cpg_real rate;
    numbers[0] = c->ramp.level;
    numbers[1] = newest->legs[0];
    numbers[2] = fades ? smoothstep(newest->progress, &rate) : 0.0;
    numbers[3] = c->frequency;
    numbers[4] = fades || newest->settling > 0.0;
    for (int16_t k = 0; k < 3; k++) {
        numbers[5 + k] = c->body->pose.now[1 + k];
    }
    gaits[0] = (int64_t)(intptr_t)c->track[c->tracks - 1 - fades]->gait;
    gaits[1] = (int64_t)(intptr_t)newest->gait;
}

void cpg_advance(cpg *c, cpg_real dt)
{
    cpg_plan(c, dt);
    cpg_move(c, dt, 0);
}

/* Go on with the gait after cpg_reach: the joints move there from where they are. */
void cpg_let_go(cpg *c, cpg_real dt)
{
    rest(c);
    c->absorbed = 0.0;
    c->jumped = 0;
    cpg_advance(c, dt);
}

/* Move joints to the wanted positions within limits; return how many those hold back. */
int cpg_confine(int joints, const cpg_real *wanted, const cpg_real *rate, const cpg_real *limits,
                cpg_real dt, cpg_real *position, cpg_real *velocity, uint8_t *behind)
{
    cpg c;
    c.joints = joints;
    for (int16_t k = 0; k < 3; k++) {
        c.limits[k] = limits + k * joints;
    }
    c.position = position;
    c.velocity = velocity;
    c.behind = behind;
    confine(&c, dt, wanted, rate);
    return c.held;
}
