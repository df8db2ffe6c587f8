
/* Return the largest distance of a watched value from the gait's orbit. */
static void watch(cpg_track *t, cpg_real off)
{
    t->distance = most(t->distance, fabs(off));
    /* The maximum may lose a NaN, which the sum keeps. */
    t->sum += off;
}

static void watch_wave(cpg_track *t, const cpg_real *x)
{
    const cpg_gait *gait = t->gait;
    const cpg_real base = t->legs[0] - gait->phase[gait->leg_cell[0]];
    for (int16_t cell = 0; cell < gait->cells; cell++) {
        cpg_real rest;
        const int16_t low = place_of(base + gait->phase[cell], CPG_ANGLES, &rest);
        const cpg_real a = gait->values[low], b = gait->values[low + 1 < CPG_ANGLES ? low + 1 : 0];
        watch(t, x[cell] - (a + rest * (b - a)));
    }
}

static void observe(const cpg_track *t, cpg_real *x, cpg_real *y, cpg_real *z)
{
    const cpg_gait *gait = t->gait;
    const cpg_real by_phase = gait->period / TURN, over = 1.0 / gait->peak;
    for (int16_t cell = 0; cell < gait->cells; cell++) {
        x[cell] = t->net.now[cell] * over;
        y[cell] = t->net.now[gait->components + cell] * by_phase * over;
        z[cell] = t->net.now[2 * gait->components + cell] * by_phase * by_phase * over;
    }
}

static void output(const cpg_track *t, cpg_real *state)
{
    memcpy(state, t->net.now, 2 * (size_t)t->gait->cells * sizeof *state);
}
