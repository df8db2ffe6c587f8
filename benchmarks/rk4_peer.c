// Copyright 2026 cpg_ros maintainers
//
// Licensed under the Apache License, Version 2.0 (the "License");
// you may not use this file except in compliance with the License.
// You may obtain a copy of the License at
//
//     http://www.apache.org/licenses/LICENSE-2.0
//
// Unless required by applicable law or agreed to in writing, software
// distributed under the License is distributed on an "AS IS" BASIS,
// WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
// See the License for the specific language governing permissions and
// limitations under the License.

/* The delayed network as one would write it in C: classical Runge-Kutta steps with cubic Hermite
   interpolation of the delayed states, every node kept (that is the dense output). Stages 2 and 3
   share one delayed state, stage 4 and the next step's first stage another.

   x, after and before have the shape (nodes + steps, CELLS): states, slopes that leave each node
   and slopes that reach it. The first `nodes` rows are the constant history. */
#include <math.h>

#define CELLS 8

static void drive(const double *past, const double *p, double *out)
{
    double squashed[CELLS];
    for (int i = 0; i < CELLS; i++)
        squashed[i] = p[2] * tanh(past[i]);
    for (int i = 0; i < CELLS; i++)
        out[i] = squashed[i ^ 1];
}

static void field(const double *x, const double *k, double weight, const double *driven,
                  const double *p, double *out)
{
    double z[CELLS], squashed[CELLS];
    for (int i = 0; i < CELLS; i++) {
        z[i] = x[i] + weight * k[i];
        squashed[i] = tanh(z[i]);
    }
    for (int i = 0; i < CELLS; i++)
        out[i] = p[0] * z[i] + p[1] * squashed[i] + p[3] * squashed[(i + CELLS - 2) % CELLS]
                 + driven[i];
}

/* The state at c steps after the node `head` minus tau. */
static void past_state(const double *x, const double *after, const double *before, long head,
                       double c, double tau, double step, double *out)
{
    double back = tau / step - c;
    long nodes = (long)ceil(back);
    if (nodes < 1)
        nodes = 1;
    long start = (head - nodes) * CELLS, end = start + CELLS;
    double s = nodes - back;
    double h01 = s * s * (3.0 - 2.0 * s), h00 = 1.0 - h01;
    double h10 = s * (s - 1.0) * (s - 1.0) * step, h11 = s * s * (s - 1.0) * step;
    for (int i = 0; i < CELLS; i++)
        out[i] = h00 * x[start + i] + h10 * after[start + i] + h01 * x[end + i]
                 + h11 * before[end + i];
}

void simulate(const double *p, double tau, double step, const double *history, long nodes,
              long steps, double *x, double *after, double *before)
{
    double past[CELLS], middle[CELLS], end[CELLS], k2[CELLS], k3[CELLS], k4[CELLS];
    for (long i = 0; i < nodes * CELLS; i++) {
        x[i] = history[i % CELLS];
        after[i] = before[i] = 0.0;
    }
    long head = nodes - 1;
    past_state(x, after, before, head, 0.0, tau, step, past);
    drive(past, p, end);
    field(history, history, 0.0, end, p, after + head * CELLS);
    for (; head < nodes + steps - 1; head++) {
        const double *now = x + head * CELLS, *k1 = after + head * CELLS;
        double *next = x + (head + 1) * CELLS, *slope = after + (head + 1) * CELLS;
        past_state(x, after, before, head, 0.5, tau, step, past);
        drive(past, p, middle);
        past_state(x, after, before, head, 1.0, tau, step, past);
        drive(past, p, end);
        field(now, k1, 0.5 * step, middle, p, k2);
        field(now, k2, 0.5 * step, middle, p, k3);
        field(now, k3, step, end, p, k4);
        for (int i = 0; i < CELLS; i++)
            next[i] = now[i] + step / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
        field(next, k4, 0.0, end, p, slope);
        for (int i = 0; i < CELLS; i++)
            before[(head + 1) * CELLS + i] = slope[i];
    }
}
