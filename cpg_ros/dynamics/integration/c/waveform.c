
#define LEAST_SQUARE R(1e-12)

/* x, x', x'' of all cells at the output, over the peak and by phase in radians. */
static void observe(const cpg_track *t, cpg_real now[3][CPG_COMPONENTS])
{
    CPG_ROM cpg_gait *gait = &cpg_gaits[t->gait];
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
    past_state(t, t->ahead / CPG_STEP, now[0]);
    for (int16_t i = 0; i < CPG_COMPONENTS; i++) {
        const cpg_real rise = t->x[t->head][i] - t->x[start][i], after = t->slope[start][i];
        now[0][i] *= over_peak;
        now[1][i] = after_1 * after + rise_1 * rise + before_1 * before[i];
        now[2][i] = after_2 * after + rise_2 * rise + before_2 * before[i];
    }
}

static void begin_clocks(cpg_track *t, cpg_real phase)
{
    (void)t;
    (void)phase;
}

#ifdef CPG_RETIMED
static cpg_real periodic(CPG_ROM cpg_real *table, int16_t width, cpg_real cycles, cpg_real *slope)
{
    cpg_real rest;
    const int16_t low = place_of(cycles, CPG_LEAD, &rest);
    const cpg_real value = lookup(table, width, CPG_LEAD, low, rest, slope);
    *slope *= (cpg_real)CPG_LEAD;
    return value;
}

/* Replace x, y and their derivatives by those at the phase that the duty factor makes of theirs. */
static void retime(CPG_ROM cpg_gait *gait, CPG_ROM cpg_real *map, cpg_real z, cpg_real *x,
                   cpg_real *y, cpg_real *dx, cpg_real *dy)
{
    const cpg_real square = *x * *x + *y * *y;
    const cpg_real turning = square > LEAST_SQUARE ? (*y * *y - *x * z) / square : R(1.0);
    cpg_real growing = square > LEAST_SQUARE ? *y * (*x + z) / square : R(0.0);
    cpg_real slope, steep;
    const cpg_real turn = F(atan2)(-*y, *x) / TURN;
    const cpg_real theta = turn + periodic(gait->turn, 2, turn, &slope);
    const cpg_real going = (R(1.0) + slope) * turning;
    const cpg_real own_x = periodic(gait->cycle, 4, theta, &slope);
    const cpg_real own_y = periodic(gait->cycle + 2, 4, theta, &slope), own_z = slope / TURN;
    const cpg_real whole = own_x * own_x + own_y * own_y;
    const cpg_real size = F(sqrt)(square / whole);
    growing = size * (growing - going * own_y * (own_x + own_z) / whole);
    const cpg_real phase = retimed_phase(theta, map, &steep);
    const cpg_real unit_x = periodic(gait->cycle, 4, phase, &slope);
    const cpg_real unit_y = periodic(gait->cycle + 2, 4, phase, &slope), unit_z = slope / TURN;
    const cpg_real speed = size * steep * going;
    *x = size * unit_x;
    *y = size * unit_y;
    *dx = speed * unit_y + growing * unit_x;
    *dy = speed * unit_z + growing * unit_y;
}
#endif

/* Read joints and legs off the network's state. */
static void look(cpg_track *t, cpg_real strides)
{
    CPG_ROM cpg_gait *gait = &cpg_gaits[t->gait];
    cpg_real now[3][CPG_COMPONENTS];
    cpg_real x = R(0.0), y = R(0.0), dx = R(0.0), dy = R(0.0);
    int16_t last = -1;
    (void)strides;
    observe(t, now);
    for (int16_t joint = 0; joint < CPG_JOINTS; joint++) {
        const int16_t cell = cpg_joint_cell[joint];
        if (cell != last) {
            last = cell;
            x = now[0][cell];
            y = dx = now[1][cell];
            dy = now[2][cell];
#ifdef CPG_RETIMED
            if (gait->turn) {
                retime(gait, gait->maps[joint], now[2][cell], &x, &y, &dx, &dy);
            }
#endif
        }
        t->angle[joint] = gait->shift[joint]
                        + joint_value(gait->weights[joint], x, y, dx, dy, &t->rise[joint]);
        t->rise[joint] *= TURN;
    }
    for (int16_t leg = 0; leg < CPG_LEGS; leg++) {
        const int16_t cell = cpg_leg_cell[leg];
        const cpg_real turn = F(atan2)(-now[1][cell], now[0][cell]) / TURN;
        cpg_real rest;
        const int16_t low = place_of(turn, CPG_LEAD, &rest);
        const cpg_real a = gait->lead[low], b = gait->lead[low + 1 < CPG_LEAD ? low + 1 : 0];
        t->legs[leg] = fraction(turn + a + rest * (b - a));
    }
}
