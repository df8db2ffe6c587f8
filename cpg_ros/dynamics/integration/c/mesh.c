/* Linear algebra of gaits on a mesh: many small systems, one after another. LAPACK takes several
 * times as long, most of it in its calls. */
#include <math.h>
#include <string.h>

/* line -= factor * above, from column `from` on. */
static void eliminate(double *restrict line, const double *restrict above, double factor, int from,
                      int width)
{
    for (int c = from; c < width; c++) {
        line[c] -= factor * above[c];
    }
}

/* Solve dY = 1 dy + L A J dY + g on each of n intervals of s nodes and d variables, k columns of
 * g, by elimination with pivots. work has room for s d rows of s d + d + k. Return 0 where a pivot
 * vanishes. */
int mesh_transfer(int n, int s, int d, int k, const double *a, const double *lengths,
                  const double *jacobians, const double *sources, double *work, double *answers)
{
    const int size = s * d, width = size + d + k;
    for (int i = 0; i < n; i++) {
        for (int row = 0; row < size; row++) {
            double *line = work + row * width;
            for (int q = 0; q < s; q++) {
                const double factor = -lengths[i] * a[row / d * s + q];
                const double *jacobian = jacobians + ((i * s + q) * d + row % d) * d;
                for (int c = 0; c < d; c++) {
                    line[q * d + c] = factor * jacobian[c];
                }
            }
            line[row] += 1.0;
            memset(line + size, 0, (size_t)d * sizeof *line);
            line[size + row % d] = 1.0;
            memcpy(line + size + d, sources + (i * size + row) * k, (size_t)k * sizeof *line);
        }
        for (int column = 0; column < size; column++) {
            int best = column;
            for (int row = column + 1; row < size; row++) {
                if (fabs(work[row * width + column]) > fabs(work[best * width + column])) {
                    best = row;
                }
            }
            double *above = work + column * width, *pivot = work + best * width;
            /* The comparison is false for NaN, too. */
            if (!(fabs(pivot[column]) > 0.0)) {
                return 0;
            }
            for (int c = column; best != column && c < width; c++) {
                const double other = above[c];
                above[c] = pivot[c];
                pivot[c] = other;
            }
            for (int row = column + 1; row < size; row++) {
                double *line = work + row * width;
                eliminate(line, above, line[column] / above[column], column + 1, width);
            }
        }
        for (int column = size - 1; column >= 0; column--) {
            double *above = work + column * width, *answer = answers + (i * size + column) * (d + k);
            for (int c = 0; c < d + k; c++) {
                answer[c] = above[size + c] /= above[column];
            }
            for (int row = 0; row < column; row++) {
                double *line = work + row * width;
                eliminate(line, above, line[column], size, width);
            }
        }
    }
    return 1;
}

/* Add the integral of J dY over each interval to steps: the answers have k columns. */
void mesh_sum(int n, int s, int d, int k, const double *weights, const double *lengths,
              const double *jacobians, const double *answers, double *steps)
{
    for (int row = 0; row < n * s * d; row++) {
        const int i = row / (s * d), node = row / d;
        for (int middle = 0; middle < d; middle++) {
            const double factor = lengths[i] * weights[node % s] * jacobians[row * d + middle];
            eliminate(steps + (i * d + row % d) * k, answers + (node * d + middle) * k, -factor, 0,
                      k);
        }
    }
}

/* Fill reached from its first matrix on, each of d rows and k columns. */
void mesh_chain(int n, int d, int k, const double *steps, double *reached)
{
    for (int row = 0; row < n * d; row++) {
        const double *step = steps + row * k, *before = reached + row / d * d * k;
        double *after = reached + (row + d) * k;
        for (int c = d; c < k; c++) {
            after[c] = step[c];
        }
        for (int middle = 0; middle < d; middle++) {
            eliminate(after, before + middle * k, -step[middle], 0, k);
        }
    }
}

/* Take d columns through all factors; whole becomes the product of what is triangular. Gram and
 * Schmidt's method twice over, which loses no orthogonality. work has room for 3 d d. */
void mesh_round(int n, int d, const double *factors, double *columns, double *whole, double *work)
{
    const int all = d * d;
    double *moved = work, *upper = work + all, *before = work + 2 * all;
    for (int k = 0; k < n; k++) {
        /* Columns lie in rows of `moved`. */
        for (int j = 0; j < d; j++) {
            for (int i = 0; i < d; i++) {
                double total = 0.0;
                for (int middle = 0; middle < d; middle++) {
                    total += factors[k * all + i * d + middle] * columns[middle * d + j];
                }
                moved[j * d + i] = total;
            }
        }
        memset(upper, 0, (size_t)all * sizeof *upper);
        for (int j = 0; j < d; j++) {
            double *one = moved + j * d, size = 0.0;
            for (int other = 0; other < 2 * j; other++) {
                const double *column = moved + other % j * d;
                double along = 0.0;
                for (int i = 0; i < d; i++) {
                    along += column[i] * one[i];
                }
                upper[other % j * d + j] += along;
                eliminate(one, column, along, 0, d);
            }
            for (int i = 0; i < d; i++) {
                size += one[i] * one[i];
            }
            upper[j * d + j] = size = sqrt(size);
            for (int i = 0; i < d; i++) {
                one[i] /= size;
                columns[i * d + j] = one[i];
            }
        }
        memcpy(before, whole, (size_t)all * sizeof *before);
        for (int i = 0; i < d; i++) {
            for (int j = i; j < d; j++) {
                double total = 0.0;
                for (int middle = i; middle <= j; middle++) {
                    total += upper[i * d + middle] * before[middle * d + j];
                }
                whole[i * d + j] = total;
            }
        }
    }
}
