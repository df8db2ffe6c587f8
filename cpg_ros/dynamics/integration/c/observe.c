
/* x, x', x'' of all cells at the output, over the peak and by phase in radians. */
static void observe(const cpg_track *t, cpg_real *x, cpg_real *y, cpg_real *z)
{
    CPG_ROM cpg_gait *gait = gait_of(t);
    const cpg_real s = R(1.0) - t->ahead / CPG_STEP, left = R(1.0) - s;
    const int16_t start = t->head > 0 ? (int16_t)(t->head - 1) : (int16_t)(CPG_NODES - 1);
    const cpg_real *before = arriving(t, t->head);
    /* Weights of both slopes and of the rise in between, for x' and x''. */
    const cpg_real one = gait->period / TURN / gait->peak;
    const cpg_real two = one * gait->period / TURN / CPG_STEP;
    const cpg_real after_1 = one * left * (R(1.0) - R(3.0) * s);
    const cpg_real before_1 = one * s * (R(3.0) * s - R(2.0));
    const cpg_real rise_1 = one * R(6.0) * s * left / CPG_STEP;
    const cpg_real after_2 = two * (R(6.0) * s - R(4.0)), before_2 = two * (R(6.0) * s - R(2.0));
    const cpg_real rise_2 = two * R(6.0) * (R(1.0) - R(2.0) * s) / CPG_STEP;
    const cpg_real over_peak = R(1.0) / gait->peak;
    past_state(t, t->ahead / CPG_STEP, x);
    for (int16_t i = 0; i < CPG_COMPONENTS; i++) {
        const cpg_real rise = t->x[t->head][i] - t->x[start][i], after = t->slope[start][i];
        x[i] *= over_peak;
        y[i] = after_1 * after + rise_1 * rise + before_1 * before[i];
        z[i] = after_2 * after + rise_2 * rise + before_2 * before[i];
    }
}
