
#define MIN_SQUARE R(1e-12)

#ifndef CPG_HOST
static void begin_clocks(cpg_track *t, cpg_real phase)
{
    (void)t;
    (void)phase;
}
#endif

#ifdef CPG_RETIMED
static cpg_real periodic(CPG_ROM cpg_real *table, int16_t width, cpg_real cycles, cpg_real *slope)
{
    cpg_real rest;
    const int16_t low = place_of(cycles, CPG_ANGLES, &rest);
    const cpg_real value = lookup(table, width, CPG_ANGLES, low, rest, slope);
    *slope *= (cpg_real)CPG_ANGLES;
    return value;
}

/* Replace x, y and their derivatives by those at the phase that the duty factor maps to. */
static void retime(CPG_ROM cpg_gait *gait, CPG_ROM cpg_real *map, cpg_real z, cpg_real *x,
                   cpg_real *y, cpg_real *dx, cpg_real *dy)
{
    const cpg_real square = *x * *x + *y * *y;
    const cpg_real turning = square > MIN_SQUARE ? (*y * *y - *x * z) / square : R(1.0);
    cpg_real growing = square > MIN_SQUARE ? *y * (*x + z) / square : R(0.0);
    cpg_real slope, steep;
    const cpg_real angle = F(atan2)(-*y, *x) / TURN;
    const cpg_real theta = angle + periodic(gait->phase_offset_slope, 2, angle, &slope);
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
    CPG_ROM cpg_gait *gait = gait_of(t);
    cpg_real now[3][CPG_COMPONENTS], signal[4] = {R(0.0), R(0.0), R(0.0), R(0.0)};
    int16_t last = -1;
    (void)strides;
    observe(t, now[0], now[1], now[2]);
    for (int16_t joint = 0; joint < CPG_JOINTS; joint++) {
        const int16_t cell = cpg_joint_cell[joint];
        if (cell != last) {
            last = cell;
            signal[0] = now[0][cell];
            signal[1] = signal[2] = now[1][cell];
            signal[3] = now[2][cell];
#ifdef CPG_RETIMED
            if (gait->phase_offset_slope) {
                retime(gait, gait->maps[joint], now[2][cell], &signal[0], &signal[1], &signal[2],
                       &signal[3]);
            }
#endif
            signal[2] *= TURN;
            signal[3] *= TURN;
        }
        drive_joint(t, gait, joint, signal);
    }
    for (int16_t leg = 0; leg < CPG_LEGS; leg++) {
        const int16_t cell = cpg_leg_cell[leg];
        const cpg_real angle = F(atan2)(-now[1][cell], now[0][cell]) / TURN;
        cpg_real rest;
        const int16_t low = place_of(angle, CPG_ANGLES, &rest);
        const cpg_real a = gait->phase_offset[low];
        const cpg_real b = gait->phase_offset[low + 1 < CPG_ANGLES ? low + 1 : 0];
        t->legs[leg] = fraction(angle + a + rest * (b - a));
    }
#ifdef CPG_HOST
    watch_wave(t, now[0]);
#endif
}
