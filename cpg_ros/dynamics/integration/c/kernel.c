
/* The entry points of integration.c_kernel in real time. */
static void begin(cpg_track *t, int head)
{
    t->head = (int16_t)head;
    memset(t->carry, 0, sizeof t->carry);
}

void set_slope(cpg_track *t, int head)
{
    begin(t, head);
    restart(t);
}

void advance(cpg_track *t, cpg_real *clock, cpg_real duration, cpg_real out[3][CPG_COMPONENTS])
{
    begin(t, (int)clock[0]);
    t->ahead = clock[1];
    run(t, duration);
    clock[0] = t->head;
    clock[1] = t->ahead;
    const int start = t->head > 0 ? t->head - 1 : t->nodes - 1;
    const cpg_real step = t->step, s = 1.0 - t->ahead / step;
    past_state(t, t->ahead / step, out[0]);
    for (int i = 0; i < CPG_COMPONENTS; i++) {
        const cpg_real rise = (t->x[t->head][i] - t->x[start][i]) / step;
        const cpg_real after = t->slope[start][i], before = t->before[t->head][i];
        out[1][i] = (1.0 - s) * (1.0 - 3.0 * s) * after + 6.0 * s * (1.0 - s) * rise
                  + s * (3.0 * s - 2.0) * before;
        out[2][i] = ((6.0 * s - 4.0) * after + 6.0 * (1.0 - 2.0 * s) * rise
                     + (6.0 * s - 2.0) * before) / step;
    }
}
