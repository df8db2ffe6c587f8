/* The pattern in a process: sizes are known at run time, and memory is the caller's. */
#include <stdint.h>
#include <string.h>

typedef double cpg_real;

@DEFINES@
#define CPG_HOST
#define CPG_STEERING
#define STEERED(c) ((c)->strides != 0)
#define STRIDES(c) ((c)->strides)
#define LEGS_OF(c) ((int16_t)(c)->strides->legs)
#define CPG_ROM const
#define CPG_WEIGHTS 6
#define CPG_VARIABLES 2
#define CPG_RETIMED
#define CPG_HARMONICS (gait->harmonics)
#define CPG_CELLS (gait->cells)
#define CPG_COMPONENTS (2 * gait->cells)
#define CPG_LEGS (gait->legs)
#define CPG_JOINTS (gait->joints)
#define cpg_joint_cell (gait->joint_cell)
#define cpg_leg_cell (gait->leg_cell)
#define cpg_joint_leg (gait->joint_leg)
#define gait_of(t) ((t)->gait)
#define TRACK(n) (c->track[n])

typedef struct {
    cpg_real frequency, period, start, peak, least;
    int32_t components, cells, joints, legs, points, harmonics, by_phase;
    const int16_t *joint_cell, *joint_leg, *leg_cell, *wave;
    const cpg_real *phase, *shift, *speed;
    const cpg_real (*weights)[CPG_WEIGHTS], (*in_place)[CPG_WEIGHTS], (*maps)[3];
    const cpg_real *waves, *shapes, *circles, *terms, *crests;
    const cpg_real *values, *phase_offset, *phase_offset_slope, *cycle;
} cpg_gait;

/* A network and its history, of size numbers in each of x, slope and before. */
typedef struct {
    void *lane;
    cpg_real *clock, *now, *x, *slope, *before;
    int64_t size;
} cpg_net;

typedef struct {
    const cpg_gait *gait;
    void (*advance)(void *lane, cpg_real *clock, cpg_real duration, cpg_real *now);
    cpg_net net, home, seed;  /* net: in use; home: the track's own; seed: on the orbit, phase 0 */
    cpg_real transition, progress, phase, phase_carry;
    cpg_real settling, calm, still, astray;  /* strides */
    cpg_real distance, sum;
    cpg_real *angle, *d_angle_d_phase, *reach, *legs, *clocks[6];
    const cpg_real *stride;  /* of each leg, 0 if nothing steers */
} cpg_track;

/* Strides of the legs and their pace, on the way to their targets; legs + 1 numbers each. */
typedef struct {
    cpg_real *now, *rate;
    const cpg_real *target, *trim;
    int32_t legs, at_once;
} cpg_smoother;

/* The pose of a body against its feet. */
typedef struct {
    cpg_smoother pose;         /* height, m, roll, pitch, yaw, rad */
    cpg_real pace, *rate;    /* factor of the time; of the joints in the stand, rad/s */
    const int16_t (*joints)[3];          /* of each leg, -1 for none */
    const cpg_real (*limbs)[8][3];       /* axes, links, hip, foot in the stand, m */
    int32_t legs, moving;
} cpg_body;

@RAMP@
typedef struct {
    int32_t joints, tracks, held, ticks_held, faults, followed, recovering, jumped;
    cpg_track *track[CPG_TRACKS];
    cpg_smoother *strides;
    cpg_body *body;
    cpg_real *offset;
    const cpg_real *limits[3], *found;
    cpg_real *position, *velocity, *wanted, *rate, *last_rate, *goal, *correction;
    cpg_real *jump, *jump_rate;
    uint8_t *behind;
    cpg_ramp ramp, approach;
    cpg_real slowing, slower, frequency, frequency_scale, substep, absorbed, fraction;
    cpg_real stall, stall_past, stall_low;
    /* Phases and state of the newest track, after each tick. */
    const cpg_real *legs, *state;
    /* Requests of other threads. go: ramp to the gait, or down if negative, s; waiting: gait. */
    cpg_real go;
    cpg_track *waiting;
} cpg;
