
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
    const cpg_real *before = end == t->kink ? t->before : t->slope[end];
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
        CPG_ROM cpg_gait *gait = &cpg_gaits[t->gait];
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

/* What is heard a delay before c steps after the head node. */
static const cpg_real *heard(const cpg_track *t, cpg_real c, cpg_real *driven)
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

/* Recompute the slope that leaves the head node, after parameters have changed. */
static void restart(cpg_track *t)
{
    cpg_real room[CPG_DRIVEN_ROOM];
    if (t->kink != t->head) {
        for (int16_t i = 0; i < CPG_COMPONENTS; i++) {
            t->before[i] = t->slope[t->head][i];
        }
        t->kink = t->head;
    }
    const cpg_real *driven = heard(t, R(0.0), room);
    cpg_real *slope = t->slope[t->head];
    rates(t, driven, t->x[t->head], R(0.0), t->before, slope);
}

/* One step of the classical Runge-Kutta method. */
void cpg_network_step(cpg_track *t)
{
    cpg_real room[CPG_DRIVEN_ROOM];
    cpg_real k2[CPG_COMPONENTS], k3[CPG_COMPONENTS], k4[CPG_COMPONENTS];
    const int16_t new = t->head + 1 < CPG_NODES ? (int16_t)(t->head + 1) : (int16_t)0;
    const cpg_real *now = t->x[t->head], *k1 = t->slope[t->head];
    /* Stages 2 and 3 share one delayed state, stage 4 and the slope at the end another. */
    const cpg_real *driven = heard(t, R(0.5), room);
    rates(t, driven, now, R(0.5) * CPG_STEP, k1, k2);
    rates(t, driven, now, R(0.5) * CPG_STEP, k2, k3);
    driven = heard(t, R(1.0), room);
    rates(t, driven, now, CPG_STEP, k3, k4);
    cpg_real *x = t->x[new];
    for (int16_t i = 0; i < CPG_COMPONENTS; i++) {
        x[i] = add(now[i], CPG_STEP / R(6.0) * (k1[i] + R(2.0) * (k2[i] + k3[i]) + k4[i]),
                   &t->carry[i]);
    }
    if (t->kink == new) {
        t->kink = -1;
    }
    rates(t, driven, x, R(0.0), k4, t->slope[new]);
    t->head = new;
}

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
