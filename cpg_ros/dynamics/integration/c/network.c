
/* State `back` steps before the head node, by the cubic Hermite interpolant. */
static void past_state(const cpg_track *t, cpg_real back, cpg_real *out)
{
    const cpg_real up = F(ceil)(back);
    const int16_t nodes = up > R(1.0) ? (int16_t)up : (int16_t)1;
    int16_t start = (int16_t)(t->head - nodes);
    if (start < 0) {
        start = (int16_t)(start + CPG_NODES);
    }
    const int16_t end = start + 1 < CPG_NODES ? (int16_t)(start + 1) : (int16_t)0;
    const cpg_real *before = arriving(t, end);
    const cpg_real s = (cpg_real)nodes - back;
    const cpg_real h11 = s * s * (s - R(1.0)) * CPG_STEP;
    const cpg_real h10 = s * (s - R(1.0)) * (s - R(1.0)) * CPG_STEP;
    const cpg_real h01 = s * s * (R(3.0) - R(2.0) * s), h00 = R(1.0) - h01;
    for (int16_t i = 0; i < CPG_COMPONENTS; i++) {
        out[i] = h00 * t->x[start][i] + h10 * t->slope[start][i]
               + h01 * t->x[end][i] + h11 * before[i];
    }
}

/* Right-hand side at z = x + weight k, with the symmetry lock -gain (I - P) z. */
static void rates(const cpg_track *t, const cpg_real *driven, const cpg_real *x, cpg_real weight,
                  const cpg_real *k, cpg_real *out)
{
    cpg_real z[CPG_COMPONENTS];
    for (int16_t i = 0; i < CPG_COMPONENTS; i++) {
        z[i] = x[i] + weight * k[i];
    }
    field(z, driven, t->p, out);
    if (t->gain > R(0.0)) {
        CPG_ROM cpg_gait *gait = gait_of(t);
        for (int16_t i = 0; i < CPG_COMPONENTS; i++) {
            out[i] -= t->gain * z[i];
        }
        for (int16_t r = 0; r < gait->basis_rows; r++) {
            CPG_ROM cpg_real *row = gait->basis + r * CPG_COMPONENTS;
            cpg_real sum = R(0.0);
            for (int16_t i = 0; i < CPG_COMPONENTS; i++) {
                sum += row[i] * z[i];
            }
            sum *= t->gain;
            for (int16_t i = 0; i < CPG_COMPONENTS; i++) {
                out[i] += sum * row[i];
            }
        }
    }
}

/* Coupling terms `driven` at c steps after the head node, from the state a delay earlier. */
static const cpg_real *delayed_terms(const cpg_track *t, cpg_real c, cpg_real *driven)
{
#if CPG_DRIVEN > 0
    cpg_real past[CPG_COMPONENTS];
    past_state(t, t->delay - c, past);
    drive(past, t->p, driven);
#else
    (void)t;
    (void)c;
#endif
    return driven;
}

/* Recompute the slope of the step that begins at the head node, after parameters have changed. */
static void restart(cpg_track *t)
{
    cpg_real room[CPG_DRIVEN_ROOM];
    begin_kink(t);
    const cpg_real *driven = delayed_terms(t, R(0.0), room);
    cpg_real *slope = t->slope[t->head];
    rates(t, driven, t->x[t->head], R(0.0), arriving(t, t->head), slope);
}

/* One step of the classical Runge-Kutta method. */
void cpg_network_step(cpg_track *t)
{
    cpg_real room[CPG_DRIVEN_ROOM];
    cpg_real k2[CPG_COMPONENTS], k3[CPG_COMPONENTS], k4[CPG_COMPONENTS];
    const int16_t new = t->head + 1 < CPG_NODES ? (int16_t)(t->head + 1) : (int16_t)0;
    const cpg_real *now = t->x[t->head], *k1 = t->slope[t->head];
    /* Stages 2 and 3 share one delayed state, stage 4 and the slope at the end another. */
    const cpg_real *driven = delayed_terms(t, R(0.5), room);
    rates(t, driven, now, R(0.5) * CPG_STEP, k1, k2);
    rates(t, driven, now, R(0.5) * CPG_STEP, k2, k3);
    driven = delayed_terms(t, R(1.0), room);
    rates(t, driven, now, CPG_STEP, k3, k4);
    cpg_real *x = t->x[new];
    for (int16_t i = 0; i < CPG_COMPONENTS; i++) {
        x[i] = add(now[i], CPG_STEP / R(6.0) * (k1[i] + R(2.0) * (k2[i] + k3[i]) + k4[i]),
                   &t->carry[i]);
    }
    rates(t, driven, x, R(0.0), k4, t->slope[new]);
    end_kink(t, new);
    t->head = new;
}

static void run(cpg_track *t, cpg_real duration)
{
    cpg_real ahead = t->ahead - duration;
    if (ahead < R(0.0)) {
        const cpg_real steps = F(ceil)(-ahead / CPG_STEP);
        for (cpg_real n = R(0.0); n < steps; n += R(1.0)) {
            cpg_network_step(t);
        }
        ahead = most(R(0.0), ahead + steps * CPG_STEP);
    }
    t->ahead = ahead;
}
