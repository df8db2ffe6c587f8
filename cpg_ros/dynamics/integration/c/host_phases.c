
#define PHASE_WEIGHT 4.0

/* PHASE_WEIGHT: weight of an error of phase, cycles, relative to one of the state, half ranges. */
static void watch_phases(cpg_track *t, cpg_real strides)
{
    const cpg_gait *gait = t->gait;
    const cpg_real *phase = t->clocks[0];
    const cpg_real base = phase[gait->leg_cell[0]] - gait->phase[gait->leg_cell[0]];
    for (int16_t cell = 0; strides > 0.0 && cell < gait->cells; cell++) {
        const cpg_real late = phase[cell] - base - gait->phase[cell];
        watch(t, PHASE_WEIGHT * (late - floor(late + 0.5)));
    }
}
