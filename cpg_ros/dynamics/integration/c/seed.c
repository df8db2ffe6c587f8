
static void load(cpg_track *t, uint8_t which)
{
    CPG_ROM cpg_gait *gait = &cpg_gaits[which];
    t->gait = which;
    t->gain = gait->gain;
    t->delay = gait->delay;
    for (int16_t k = 0; k < CPG_PARAMETERS; k++) {
        t->p[k] = gait->p[k];
    }
    for (int16_t i = 0; i < CPG_COMPONENTS; i++) {
        t->carry[i] = R(0.0);
    }
    t->head = CPG_NODES - 1;
    t->kink = -1;
    t->ahead = R(0.0);
}

void cpg_network_hold(cpg_track *t, uint8_t gait, const cpg_real *x)
{
    load(t, gait);
    for (int16_t node = 0; node < CPG_NODES; node++) {
        for (int16_t i = 0; i < CPG_COMPONENTS; i++) {
            t->x[node][i] = x[i];
            t->slope[node][i] = R(0.0);
        }
    }
    restart(t);
}

/* Put the network on its orbit, at a phase of it in cycles, its nodes where steps from phase 0
 * would have them. */
static void seed(cpg_track *t, uint8_t which, cpg_real phase)
{
    load(t, which);
    CPG_ROM cpg_gait *gait = &cpg_gaits[which];
    const cpg_real steps = gait->period / CPG_STEP;
    const cpg_real nodes = F(ceil)(phase * steps);
    t->ahead = (nodes - phase * steps) * CPG_STEP;
    for (int16_t node = 0; node < CPG_NODES; node++) {
        const cpg_real at = (nodes - (cpg_real)(CPG_NODES - 1 - node)) / steps;
        for (int16_t cell = 0; cell < CPG_CELLS; cell++) {
            cpg_real rest, slope;
            const int16_t low = place_of(at + gait->phase[cell], gait->points, &rest);
            for (int16_t v = 0; v < CPG_VARIABLES; v++) {
                CPG_ROM cpg_real *wave = gait->waves + (int32_t)(
                    gait->wave[cell] * CPG_VARIABLES + v) * gait->points * 2;
                const int16_t i = (int16_t)(v * CPG_CELLS + cell);
                t->x[node][i] = lookup(wave, 2, gait->points, low, rest, &slope);
                t->slope[node][i] = slope * (cpg_real)gait->points / gait->period;
            }
        }
    }
    restart(t);
}
