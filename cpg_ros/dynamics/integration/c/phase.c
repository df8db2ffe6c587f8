
#define PHASE_GAIN R(1.0)
#define SMOOTHING R(0.25)
#define MAX_TURN R(0.5)
#define MAX_STATE R(2.0)

enum { PHASE, SPEED, NEXT_SPEED, AMPLITUDE, GROWTH, NEXT_GROWTH };

#ifndef CPG_HOST
static void output(const cpg_track *t, cpg_real *state)
{
    past_state(t, t->ahead / CPG_STEP, state);
}
#endif

static void begin_clocks(cpg_track *t, cpg_real phase)
{
    CPG_ROM cpg_gait *gait = gait_of(t);
    for (int16_t cell = 0; cell < CPG_CELLS; cell++) {
        for (int16_t k = 0; k < 6; k++) {
            t->clocks[k][cell] = R(0.0);
        }
        t->clocks[PHASE][cell] = fraction(phase + gait->phase[cell]);
        t->clocks[AMPLITUDE][cell] = R(1.0);
    }
}

/* Correct a cell's clock by the cell's state; now is its first two variables. */
static void pull_clock(cpg_track *t, int16_t cell, cpg_real strides, const cpg_real *now)
{
    CPG_ROM cpg_gait *gait = gait_of(t);
    const int16_t wave = gait->wave[cell];
    CPG_ROM cpg_real *shape = gait->shapes + 4 * wave, *circle = gait->circles + 4 * wave;
    CPG_ROM cpg_real *table = gait->waves + (int32_t)wave * CPG_VARIABLES * gait->points * 2;
    const cpg_real phase = t->clocks[PHASE][cell], amplitude = t->clocks[AMPLITUDE][cell];
    const cpg_real pull = PHASE_GAIN / (R(1.0) + R(2.0) * PHASE_GAIN * strides);
    const cpg_real gain = strides / (SMOOTHING + strides);
    const cpg_real c1 = F(cos)(TURN * phase), s1 = F(sin)(TURN * phase);
    cpg_real rest, slope, off[2];
#ifdef CPG_HOST
    watch(t, amplitude - R(1.0));
#endif
    const int16_t low = place_of(phase, gait->points, &rest);
    for (int16_t v = 0; v < 2; v++) {
        const cpg_real there = lookup(table + (int32_t)v * gait->points * 2, 2, gait->points, low,
                                      rest, &slope);
        const cpg_real mean = shape[v], half = shape[2 + v];
        const cpg_real at = (now[v] - mean) / half;
#ifdef CPG_HOST
        watch(t, (now[v] - there) / half);
#endif
        off[v] = within(at, -MAX_STATE, MAX_STATE) - amplitude * (there - mean) / half;
    }
    const cpg_real along = (circle[0] * c1 + circle[1] * s1) * off[0]
                         + (circle[2] * c1 + circle[3] * s1) * off[1];
    const cpg_real across = (circle[1] * c1 - circle[0] * s1) * off[0]
                          + (circle[3] * c1 - circle[2] * s1) * off[1];
    t->clocks[NEXT_SPEED][cell] += gain * (
        within(pull * across / TURN, -MAX_TURN, MAX_TURN) - t->clocks[NEXT_SPEED][cell]);
    t->clocks[NEXT_GROWTH][cell] += gain * (pull * along - t->clocks[NEXT_GROWTH][cell]);
}

/* x and y of a cell by its clock, and their derivatives by the strides. */
static void signal_of(const cpg_track *t, int16_t cell, int16_t joint, cpg_real *signal)
{
    CPG_ROM cpg_gait *gait = gait_of(t);
    CPG_ROM cpg_real *terms = gait->terms + gait->wave[cell] * 2 * (1 + CPG_HARMONICS);
    cpg_real phase = t->clocks[PHASE][cell], steep = R(1.0);
    const cpg_real amplitude = t->clocks[AMPLITUDE][cell];
#ifdef CPG_RETIMED
    if (gait->maps[joint][0] != R(1.0)) {
        phase = retimed_phase(phase, gait->maps[joint], &steep);
    }
#else
    (void)joint;
#endif
    const cpg_real c1 = F(cos)(TURN * phase), s1 = F(sin)(TURN * phase);
    cpg_real x = terms[0], y = R(0.0), z = R(0.0), c = R(1.0), s = R(0.0);
    for (int16_t k = 1; k <= CPG_HARMONICS; k++) {
        const cpg_real number = (cpg_real)k, last = c;
        c = c * c1 - s * s1;
        s = s * c1 + last * s1;
        const cpg_real in_phase = terms[2 * k] * c + terms[2 * k + 1] * s;
        x += in_phase;
        y += number * (terms[2 * k + 1] * c - terms[2 * k] * s);
        z -= number * number * in_phase;
    }
    cpg_real scale = R(1.0), rate = R(0.0);
    const cpg_real speed = steep * TURN * (R(1.0) + t->clocks[SPEED][cell]);
    if (amplitude < R(1.0)) {
        const cpg_real left = amplitude > R(0.0) ? R(1.0) - amplitude * amplitude : R(1.0);
        scale = R(1.0) - left * left * left;
        rate = R(6.0) * most(amplitude, R(0.0)) * left * left * t->clocks[GROWTH][cell];
    }
    signal[0] = scale * x;
    signal[1] = scale * y;
    signal[2] = scale * y * speed + rate * x;
    signal[3] = scale * z * speed + rate * y;
}

/* Advance the cells' clocks by some strides and read joints and legs off them. */
static void look(cpg_track *t, cpg_real strides)
{
    CPG_ROM cpg_gait *gait = gait_of(t);
    if (strides > R(0.0)) {
        cpg_real state[CPG_COMPONENTS];
        output(t, state);
        for (int16_t cell = 0; cell < CPG_CELLS; cell++) {
            const cpg_real now[2] = {state[cell], state[CPG_CELLS + cell]};
            /* Both rates are linear in between, so that this is their exact integral. */
            t->clocks[PHASE][cell] = fraction(t->clocks[PHASE][cell] + strides * (R(1.0) + R(0.5) * (
                t->clocks[SPEED][cell] + t->clocks[NEXT_SPEED][cell])));
            t->clocks[SPEED][cell] = t->clocks[NEXT_SPEED][cell];
            t->clocks[AMPLITUDE][cell] += R(0.5) * strides * (
                t->clocks[GROWTH][cell] + t->clocks[NEXT_GROWTH][cell]);
            t->clocks[GROWTH][cell] = t->clocks[NEXT_GROWTH][cell];
            pull_clock(t, cell, strides, now);
        }
    }
    int16_t last = -1;
    cpg_real signal[4] = {R(0.0), R(0.0), R(0.0), R(0.0)};
    for (int16_t joint = 0; joint < CPG_JOINTS; joint++) {
        if (cpg_joint_cell[joint] != last) {
            last = cpg_joint_cell[joint];
            signal_of(t, last, joint, signal);
        }
        drive_joint(t, gait, joint, signal);
    }
    for (int16_t leg = 0; leg < CPG_LEGS; leg++) {
        const int16_t cell = cpg_leg_cell[leg];
        t->legs[leg] = fraction(t->clocks[PHASE][cell] - gait->crests[gait->wave[cell]]);
    }
#ifdef CPG_HOST
    watch_phases(t, strides);
#endif
}
