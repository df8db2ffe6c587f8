
/* The gait's orbit as a table: joints and legs by the phase alone. */
static void look(cpg_track *t)
{
    CPG_ROM cpg_gait *gait = gait_of(t);
    cpg_real last = R(-1.0), t1, ab = R(0.0), da = R(0.0), db = R(0.0);
    cpg_real ab_rise = R(0.0), da_rise = R(0.0), db_rise = R(0.0);
    int16_t low = 0, high = 0;
    for (int16_t joint = 0; joint < CPG_JOINTS; joint++) {
        const cpg_real phase = gait->joint_phase[joint];
        /* Joints of one leg mostly share their phase, and so the weights of the cubic. */
        if (phase < last || phase > last) {
            const cpg_real scale = (cpg_real)gait->points;
            low = place_of(t->orbit_phase + phase, gait->points, &t1);
            high = low + 1 < gait->points ? (int16_t)(2 * low + 2) : (int16_t)0;
            low = (int16_t)(2 * low);
            const cpg_real square = t1 * t1, left = R(1.0) - t1;
            ab = square * (R(3.0) - R(2.0) * t1);
            da = t1 * left * left;
            db = -square * left;
            ab_rise = R(6.0) * t1 * left * scale;
            da_rise = left * (R(1.0) - R(3.0) * t1) * scale;
            db_rise = t1 * (R(3.0) * t1 - R(2.0)) * scale;
            last = phase;
        }
        CPG_ROM cpg_real *table = gait->tables + (int32_t)gait->joint_table[joint]
                                * gait->points * 2;
        const cpg_real a = table[low], gap = table[high] - a;
        const cpg_real a_slope = table[low + 1], b_slope = table[high + 1];
        t->angle[joint] = gait->shift[joint] + a + ab * gap + da * a_slope + db * b_slope;
        t->d_angle_d_phase[joint] = ab_rise * gap + da_rise * a_slope + db_rise * b_slope;
    }
    for (int16_t leg = 0; leg < CPG_LEGS; leg++) {
        t->legs[leg] = fraction(t->orbit_phase + gait->leg_phase[leg]);
    }
    t->phase = t->legs[0];
}

static void align(cpg_track *t, uint8_t gait, cpg_real phase)
{
    t->gait = gait;
    t->phase_carry = R(0.0);
    t->orbit_phase = fraction(phase - cpg_gaits[gait].start);
    look(t);
}

static void move(cpg_track *t, cpg_real strides)
{
    t->orbit_phase = turned(t->orbit_phase, strides, &t->phase_carry);
    look(t);
}
