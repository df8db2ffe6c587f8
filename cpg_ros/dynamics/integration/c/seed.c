
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

/* A joint's deviation from its offset: w0 x + w1 y + w2 x^2 + w3 xy + w4 x^3 + w5 x^2 y; rise is its
 * derivative from those of x and y. */
static cpg_real joint_value(CPG_ROM cpg_real *w, cpg_real x, cpg_real y, cpg_real dx, cpg_real dy,
                            cpg_real *rise)
{
    cpg_real value = w[0] * x, by_x = w[0];
#if CPG_WEIGHTS > 1
    cpg_real by_y = w[1];
    value += w[1] * y;
#endif
#if CPG_WEIGHTS > 2
    value += w[2] * x * x + w[3] * x * y;
    by_x += R(2.0) * w[2] * x + w[3] * y;
    by_y += w[3] * x;
#endif
#if CPG_WEIGHTS > 4
    value += (w[4] * x + w[5] * y) * x * x;
    by_x += R(3.0) * w[4] * x * x + R(2.0) * w[5] * x * y;
    by_y += w[5] * x * x;
#endif
    *rise = by_x * dx;
#if CPG_WEIGHTS > 1
    *rise += by_y * dy;
#else
    (void)y;
    (void)dy;
#endif
    return value;
}

#ifdef CPG_RETIMED
/* The phase at which joints are read for another duty factor, and its derivative. */
static cpg_real retimed_phase(cpg_real phase, CPG_ROM cpg_real *map, cpg_real *steep)
{
    const cpg_real angle = R(0.5) * TURN * (phase - map[1]);
    const cpg_real s = F(sin)(angle), c = F(cos)(angle);
    *steep = map[0] / (c * c + map[0] * map[0] * s * s);
    return map[2] + F(atan2)(map[0] * s, c) / (R(0.5) * TURN);
}
#endif
