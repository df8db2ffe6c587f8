
/* A joint's deviation from its offset: w0 x + w1 y + w2 x^2 + w3 xy + w4 x^3 + w5 x^2 y;
 * d_angle is its derivative, from those of x and y. */
static cpg_real joint_value(CPG_ROM cpg_real *w, cpg_real x, cpg_real y, cpg_real dx, cpg_real dy,
                            cpg_real *d_angle)
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
    *d_angle = by_x * dx;
#if CPG_WEIGHTS > 1
    *d_angle += by_y * dy;
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

/* Fill in a joint's angle and its derivative by phase, from x and y of its cell and theirs. */
static void drive_joint(cpg_track *t, CPG_ROM cpg_gait *gait, int16_t joint,
                        const cpg_real *signal)
{
    cpg_real angle = joint_value(gait->weights[joint], signal[0], signal[1], signal[2], signal[3],
                                 &t->d_angle_d_phase[joint]);
#ifdef CPG_STEERING
    if (t->stride) {
        /* angle = in_place + stride (angle - in_place), and so its derivatives. */
        cpg_real lift;
        const cpg_real longer = t->stride[cpg_joint_leg[joint]] - R(1.0);
        t->reach[joint] = angle - joint_value(gait->in_place[joint], signal[0], signal[1],
                                              signal[2], signal[3], &lift);
        t->d_angle_d_phase[joint] += longer * (t->d_angle_d_phase[joint] - lift);
        angle += longer * t->reach[joint];
    }
#endif
    t->angle[joint] = gait->shift[joint] + angle;
}
