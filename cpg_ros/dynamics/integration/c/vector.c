/* Elementary functions without branches, which compilers vectorise; libm's they do not.
 * exp and tanh are within 4 units in the last place. */
#include <math.h>
#include <stdint.h>
#include <string.h>

/* Return expm1(r) with z = n ln 2 + r, |r| <= ln(2)/2, for |z| <= 708; power is 2^n. */
static inline double reduced(double z, double *power)
{
    /* Adding 1.5 * 2^52 rounds to an integer and leaves it in the low bits of the mantissa. */
    const double rounded = z * 1.4426950408889634 + 6755399441055744.0;
    const double n = rounded - 6755399441055744.0;
    /* ln 2 is split so that n times its high part is exact (fdlibm). */
    const double r = (z - n * 6.93147180369123816490e-01) - n * 1.90821492927058770002e-10;
    /* sum_{k=2}^{13} r^(k-2) / k!, in Estrin's order: short chains of dependent operations. */
    const double r2 = r * r, r4 = r2 * r2;
    const double low = (0.5 + r * (1.0 / 6)) + r2 * ((1.0 / 24) + r * (1.0 / 120));
    const double middle = (1.0 / 720 + r * (1.0 / 5040))
                        + r2 * (1.0 / 40320 + r * (1.0 / 362880));
    const double high = (1.0 / 3628800 + r * (1.0 / 39916800))
                      + r2 * (1.0 / 479001600 + r * (1.0 / 6227020800));
    uint64_t bits;
    memcpy(&bits, &rounded, sizeof bits);
    bits = (bits + 1023) << 52;
    memcpy(power, &bits, sizeof bits);
    return r + r2 * (low + r4 * (middle + r4 * high));
}

/* NaN stays NaN, and the function is exactly odd. */
static inline double vector_tanh(double x)
{
    const double size = fabs(x);
    double power;
    const double rest = reduced(2.0 * (size > 20.0 ? 20.0 : size), &power);
    const double expm1 = power * rest + (power - 1.0);
    return copysign(expm1 / (expm1 + 2.0), x);
}

/* Limited to exp(-700) and exp(700). */
static inline double vector_exp(double x)
{
    const double low = x > 700.0 ? 700.0 : x;
    double power;
    const double rest = reduced(low < -700.0 ? -700.0 : low, &power);
    return power + power * rest;
}

#define vector_cos cos
#define vector_cosh cosh
#define vector_fabs fabs
#define vector_log log
#define vector_pow pow
#define vector_sin sin
#define vector_sqrt sqrt
