#define CPG_INTERNAL
#include "cpg.h"

#include <math.h>

#ifdef CPG_FLOAT32
#define R(x) x##f
#define F(name) name##f
#else
#define R(x) x
#define F(name) name
#endif
#define TURN R(6.283185307179586477)

static cpg_real least(cpg_real a, cpg_real b)
{
    return a < b ? a : b;
}

static cpg_real most(cpg_real a, cpg_real b)
{
    return a > b ? a : b;
}

static cpg_real within(cpg_real value, cpg_real low, cpg_real high)
{
    return least(most(value, low), high);
}

/* Return a caller's time, s, limited to low and high; NaN becomes low. */
static cpg_real time_within(cpg_real time, cpg_real low, cpg_real high)
{
    return time > low ? least(time, high) : low;
}

static cpg_real fraction(cpg_real cycles)
{
    const cpg_real found = cycles - F(floor)(cycles);
    return found < R(1.0) ? found : R(0.0);
}

/* Add to a sum whose rounding errors are carried along, which would add up to a drift. */
static cpg_real add(cpg_real sum, cpg_real value, cpg_real *carry)
{
    const cpg_real corrected = value - *carry, found = sum + corrected;
    *carry = (found - sum) - corrected;
    return found;
}

/* Advance a phase in cycles, 0 to 1. */
static cpg_real turned(cpg_real phase, cpg_real by, cpg_real *carry)
{
    const cpg_real found = add(phase, by, carry);
    return found - F(floor)(found);
}

/* Return the entry of a periodic table at a phase; rest is the distance beyond that entry. */
static int16_t place_of(cpg_real cycles, int16_t points, cpg_real *rest)
{
    const cpg_real place = fraction(cycles) * (cpg_real)points;
    /* NaN fails this comparison, too, so that it does not become an index. */
    int16_t low = place >= R(0.0) ? (int16_t)place : (int16_t)0;
    *rest = place - (cpg_real)low;
    return low < points ? low : (int16_t)0;
}

#ifndef CPG_TABLE
/* Cubic of values a, b and slopes da, db per point; slope is its derivative, per point. */
static cpg_real hermite(cpg_real a, cpg_real da, cpg_real b, cpg_real db, cpg_real t,
                        cpg_real *slope)
{
    const cpg_real gap = b - a;
    const cpg_real c2 = R(3.0) * gap - R(2.0) * da - db, c3 = da + db - R(2.0) * gap;
    *slope = da + t * (R(2.0) * c2 + R(3.0) * c3 * t);
    return a + t * (da + t * (c2 + t * c3));
}

/* Periodic table with rows of a width, value and slope per point at a column of them. */
static cpg_real lookup(CPG_ROM cpg_real *table, int16_t width, int16_t points, int16_t low,
                       cpg_real t, cpg_real *slope)
{
    CPG_ROM cpg_real *here = table + (int32_t)low * width;
    CPG_ROM cpg_real *there = table + (low + 1 < points ? (int32_t)(low + 1) * width : 0);
    return hermite(here[0], here[1], there[0], there[1], t, slope);
}
#endif
