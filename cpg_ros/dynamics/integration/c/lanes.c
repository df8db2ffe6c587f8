/* Steps of several trajectories of a network at once, one in each lane of vector registers. Cells
 * are counted over all lanes: lane l of cell c is c * LANES + l. */
typedef double cpg_real;

#define CPG_ROM const
#define R(x) x
#define F(name) vector_##name
@DEFINES@
#define EACH(i) for (int c = 0; c < CPG_CELLS; c += LANES) for (int i = c; i < c + LANES; i++)
#define FROM(source, i) ((source)[c / LANES] * LANES + (i) - c)
#define PARTS (CPG_COMPONENTS / LANES)

@FIELD@

/* A network, its symmetry lock and its history; delays in model time, one for each lane. */
typedef struct {
    const double *p, *delay, *basis;
    double *x, *after, *before;
    double gain, step;
    int basis_rows, nodes;
} block;

#if CPG_DRIVEN > 0
/* States a delay before c steps after the head node, by the cubic Hermite interpolant. */
static void past_state(const block *b, int head, double c, double *out)
{
    for (int l = 0; l < LANES; l++) {
        const double back = b->delay[l] / b->step - c;
        const int nodes = back > 1.0 ? (int)ceil(back) : 1;
        const long start = head < nodes ? head - nodes + b->nodes : head - nodes;
        const long end = start + 1 < b->nodes ? start + 1 : 0;
        const double s = nodes - back;
        const double h11 = s * s * (s - 1.0) * b->step;
        const double h10 = s * (s - 1.0) * (s - 1.0) * b->step;
        const double h01 = s * s * (3.0 - 2.0 * s), h00 = 1.0 - h01;
        const double *x0 = b->x + start * CPG_COMPONENTS, *k0 = b->after + start * CPG_COMPONENTS;
        const double *x1 = b->x + end * CPG_COMPONENTS, *k1 = b->before + end * CPG_COMPONENTS;
        for (int i = l; i < CPG_COMPONENTS; i += LANES) {
            out[i] = h00 * x0[i] + h10 * k0[i] + h01 * x1[i] + h11 * k1[i];
        }
    }
}
#endif

/* Coupling terms at c steps after the head node, from the state a delay earlier. */
static void delayed_terms(const block *b, int head, double c, double *driven)
{
#if CPG_DRIVEN > 0
    double past[CPG_COMPONENTS];
    past_state(b, head, c, past);
    drive(past, b->p, driven);
#else
    (void)b;
    (void)head;
    (void)c;
    (void)driven;
#endif
}

/* Right-hand side at z = x + weight k, with the symmetry lock -gain (I - P) z. */
static void rates(const block *b, const double *driven, const double *x, double weight,
                  const double *k, double *out)
{
    double z[CPG_COMPONENTS];
    for (int i = 0; i < CPG_COMPONENTS; i++) {
        z[i] = x[i] + weight * k[i];
    }
    field(z, driven, b->p, out);
    if (b->gain != 0.0) {
        for (int i = 0; i < CPG_COMPONENTS; i++) {
            out[i] -= b->gain * z[i];
        }
        for (int r = 0; r < b->basis_rows; r++) {
            const double *row = b->basis + r * PARTS;
            double along[LANES] = {0};
            for (int k = 0; k < PARTS; k++) {
                for (int l = 0; l < LANES; l++) {
                    along[l] += row[k] * z[k * LANES + l];
                }
            }
            for (int k = 0; k < PARTS; k++) {
                for (int l = 0; l < LANES; l++) {
                    out[k * LANES + l] += b->gain * along[l] * row[k];
                }
            }
        }
    }
}

/* Compute the slope that leaves the head node. */
void begin(const block *b, int head)
{
    double driven[CPG_DRIVEN_ROOM];
    const double *x = b->x + (long)head * CPG_COMPONENTS;
    delayed_terms(b, head, 0.0, driven);
    rates(b, driven, x, 0.0, x, b->after + (long)head * CPG_COMPONENTS);
}

/* Take steps of the classical Runge-Kutta method, the first one number `row`, and record every
 * so many; return the new head. `kicks` are added to each state in turn, unless it is NULL.
 * `states` and `slopes` have `rows` rows for each lane. */
int steps(const block *b, int head, int count, const double *kicks, int every, int row, int rows,
          double *states, double *slopes)
{
    double middle[CPG_DRIVEN_ROOM], end[CPG_DRIVEN_ROOM];
    double k2[CPG_COMPONENTS], k3[CPG_COMPONENTS], k4[CPG_COMPONENTS];
    const double step = b->step;
    for (const int last = row + count; row < last; row++) {
        const int new = head + 1 < b->nodes ? head + 1 : 0;
        const double *now = b->x + (long)head * CPG_COMPONENTS;
        const double *k1 = b->after + (long)head * CPG_COMPONENTS;
        double *x = b->x + (long)new * CPG_COMPONENTS;
        double *after = b->after + (long)new * CPG_COMPONENTS;
        /* Stages 2 and 3 share one delayed state, stage 4 and the next step's first another. */
        delayed_terms(b, head, 0.5, middle);
        rates(b, middle, now, 0.5 * step, k1, k2);
        rates(b, middle, now, 0.5 * step, k2, k3);
        delayed_terms(b, head, 1.0, end);
        rates(b, end, now, step, k3, k4);
        for (int i = 0; i < CPG_COMPONENTS; i++) {
            x[i] = now[i] + step / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
        }
        for (int i = 0; kicks && i < CPG_COMPONENTS; i++) {
            x[i] += *kicks++;
        }
        rates(b, end, x, 0.0, k4, after);
        memcpy(b->before + (long)new * CPG_COMPONENTS, after, sizeof k2);
        for (int l = 0; row % every == 0 && l < LANES; l++) {
            const long here = ((long)l * rows + row / every) * PARTS;
            for (int i = 0; i < PARTS; i++) {
                states[here + i] = x[i * LANES + l];
                slopes[here + i] = after[i * LANES + l];
            }
        }
        head = new;
    }
    return head;
}
