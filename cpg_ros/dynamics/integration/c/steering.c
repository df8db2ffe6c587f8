/* Time constant with which strides and pace approach their targets, s. */
#define TIME_CONSTANT R(0.2)

/* e(t) = (e + (v + e / T) t) exp(-t / T), e the distance from the target. */
static void approach(cpg_smoother *value, int16_t legs, cpg_real dt)
{
    const cpg_real decay = F(exp)(-dt / TIME_CONSTANT);
    const uint8_t at_once = value->at_once != 0;
    for (int16_t k = 0; k <= legs; k++) {
        cpg_real target = value->target[k];
        if (at_once) {
            value->now[k] = target;
            value->rate[k] = R(0.0);
            continue;
        }
#ifdef CPG_HOST
        if (value->trim && k < legs) {
            target = within(target + value->trim[k], -1.0, 1.0);
        }
#endif
        const cpg_real gap = value->now[k] - target, pull = value->rate[k] + gap / TIME_CONSTANT;
        value->now[k] = target + (gap + pull * dt) * decay;
        value->rate[k] = (value->rate[k] - pull * dt / TIME_CONSTANT) * decay;
    }
    if (at_once) {
        value->at_once = 0;
    }
}

/* Advance the steering, if there is one; return the pace. */
static cpg_real steered(cpg *c, cpg_real dt)
{
    if (!STEERED(c)) {
        return R(1.0);
    }
    const int16_t legs = LEGS_OF(c);
    approach(STRIDES(c), legs, dt);
    return STRIDES(c)->now[legs];
}

static cpg_real speed_of(const cpg *c, const cpg_track *t, int16_t joint, cpg_real frequency)
{
    CPG_ROM cpg_gait *gait = gait_of(t);
    (void)gait;
    const cpg_real speed = t->d_angle_d_phase[joint] * frequency;
    return STEERED(c) ? speed + STRIDES(c)->rate[cpg_joint_leg[joint]] * t->reach[joint] : speed;
}
