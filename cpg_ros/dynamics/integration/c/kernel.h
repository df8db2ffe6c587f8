/* Definitions for network.c if the sizes of a history are known at run time only. */
#include <stdint.h>
#include <string.h>

typedef double cpg_real;

#define CPG_ROM const
@DEFINES@
#define CPG_NODES (t->nodes)
#define CPG_STEP (t->step)
#define gait_of(t) (&(t)->lock)

typedef struct {
    int16_t basis_rows;
    const cpg_real *basis;
} cpg_gait;

typedef struct {
    const cpg_real *p;
    cpg_real gain, delay, step, ahead;
    cpg_real (*x)[CPG_COMPONENTS], (*slope)[CPG_COMPONENTS], (*before)[CPG_COMPONENTS];
    cpg_gait lock;
    int16_t gait, nodes, head;
    cpg_real carry[CPG_COMPONENTS];
} cpg_track;
