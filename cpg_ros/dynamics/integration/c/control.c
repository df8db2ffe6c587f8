
#define MIN_RAMP R(0.05)
/* MAX_RAMP: longest ramp or fade, s; MAX_TICK: longest tick, s. */
#define MAX_RAMP R(3600.0)
#define MAX_TICK R(1.0)

void cpg_start(cpg *c, uint8_t gait, cpg_real ramp)
{
    if (gait >= CPG_GAITS) {
        gait = 0;
    }
    for (int16_t joint = 0; joint < CPG_JOINTS; joint++) {
        c->position[joint] = cpg_offset[joint];
        c->velocity[joint] = c->last_rate[joint] = R(0.0);
        c->behind[joint] = 0;
    }
    c->held = c->waiting = c->followed = 0;
    c->tracks = 1;
#ifdef CPG_STEERING
    for (int16_t k = 0; k <= CPG_LEGS; k++) {
        c->strides.now[k] = c->strides.target[k] = R(1.0);
        c->strides.rate[k] = R(0.0);
    }
    c->strides.at_once = 0;
    c->track[0].stride = c->strides.now;
#endif
    c->track[0].transition = c->track[0].progress = R(0.0);
    align(&c->track[0], gait, R(0.0));
    c->slowing = c->slower = R(1.0);
    c->frequency = cpg_gaits[gait].frequency;
    c->level = c->ramp.level = c->ramp.rate = c->transition = R(0.0);
    ramp_to(&c->ramp, R(1.0), time_within(ramp, MIN_RAMP, MAX_RAMP));
}

void cpg_enable(cpg *c, uint8_t enabled, cpg_real ramp)
{
    ramp_to(&c->ramp, enabled ? R(1.0) : R(0.0), time_within(ramp, MIN_RAMP, MAX_RAMP));
}

void cpg_switch(cpg *c, uint8_t gait, cpg_real transition)
{
    if (gait < CPG_GAITS) {
        c->waiting = (uint8_t)(gait + 1);
        c->transition = time_within(transition, MIN_RAMP, MAX_RAMP);
    }
}

#ifdef CPG_STEERING
/* NaN fails this comparison, so that it keeps the target. */
static void aim(cpg_real *target, cpg_real value, cpg_real low, cpg_real high)
{
    if (value >= low || value < low) {
        *target = within(value, low, high);
    }
}

void cpg_steer(cpg *c, const cpg_real *stride, cpg_real pace)
{
    for (int16_t leg = 0; leg < CPG_LEGS; leg++) {
        aim(&c->strides.target[leg], stride[leg], R(-1.0), R(1.0));
    }
    aim(&c->strides.target[CPG_LEGS], pace, R(0.0), R(2.0));
    /* Nothing moves at the stand. */
    c->strides.at_once = !(c->ramp.level > R(0.0));
}
#endif

const cpg_real *cpg_leg_phases(const cpg *c)
{
    return c->track[c->tracks - 1].legs;
}

static void take_waiting(cpg *c)
{
    if (FADES && c->waiting && c->tracks < CPG_TRACKS) {
        cpg_track *t = &c->track[c->tracks];
        t->transition = c->transition;
        t->progress = R(0.0);
#ifdef CPG_STEERING
        t->stride = c->strides.now;
#endif
        align(t, (uint8_t)(c->waiting - 1), c->track[c->tracks - 1].phase);
        c->tracks++;
        c->waiting = 0;
    }
}

void cpg_advance(cpg *c, cpg_real dt)
{
    cpg_real wanted[CPG_JOINTS], rate[CPG_JOINTS];
    dt = time_within(dt, R(0.0), MAX_TICK);
#ifdef CPG_STEERING
    /* Point to the strides of this struct, which may have been copied. */
    for (int16_t n = 0; n < c->tracks; n++) {
        c->track[n].stride = c->strides.now;
    }
#endif
    take_waiting(c);
    if (c->tracks == 1 && c->ramp.parts == 0) {
        cruise(c, dt, wanted, rate);
    } else {
        const cpg_real parts = most(R(1.0), F(ceil)(dt / CPG_SUBSTEP - R(1e-4)));
        for (cpg_real n = R(0.0); n < parts; n += R(1.0)) {
            part_of_tick(c, dt / parts, wanted, rate);
        }
    }
    c->level = c->ramp.level;
    confine(c, dt, wanted, rate);
}
