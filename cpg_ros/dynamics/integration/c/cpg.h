/* @TITLE@
 *
 * cpg_start once, then cpg_advance once a tick: position and velocity of every joint. Between
 * ticks cpg_switch changes the gait and cpg_enable ramps to the stand and back. Nothing here
 * allocates memory, calls itself or waits; a struct cpg holds all that changes. Times of ramps and
 * fades are taken as 0.05 s to an hour, whatever they are.
 */
#ifndef CPG_H
#define CPG_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef @REAL@ cpg_real;

@DEFINES@

/* Most gaits that fade into one another at a time; each takes the memory of a cpg_track. */
#ifndef CPG_TRACKS
#define CPG_TRACKS @TRACKS@
#endif
/* Longest part of a tick while gaits fade or the ramp moves, s. */
#ifndef CPG_SUBSTEP
#define CPG_SUBSTEP @SUBSTEP@
#endif

typedef struct {
    uint8_t gait;
    cpg_real transition, progress;  /* s, and the fraction of it that is over */
    cpg_real phase, phase_carry;    /* of the first leg, cycles */
    cpg_real angle[CPG_JOINTS];     /* from the stand, rad */
    cpg_real d_angle_d_phase[CPG_JOINTS];  /* rad per cycle */
    cpg_real legs[CPG_LEGS];        /* phase of each leg, cycles */
#ifdef CPG_STEERING
    const cpg_real *stride;
    cpg_real reach[CPG_JOINTS];     /* derivative of the angle by the stride, rad */
#endif
#ifdef CPG_TABLE
    cpg_real orbit_phase;           /* cycles */
#else
    cpg_real p[CPG_PARAMETERS];     /* the network's, those of a group one for each cell */
    cpg_real gain, delay;           /* of the symmetry lock, 1/model time; in steps */
    cpg_real ahead;                 /* model time from the output to the newest node */
    int16_t head, kink;             /* the newest node; that with two slopes, or -1 */
    cpg_real x[CPG_NODES][CPG_COMPONENTS];
    cpg_real slope[CPG_NODES][CPG_COMPONENTS];
    cpg_real before[CPG_COMPONENTS];  /* slope that arrives at the kink */
    cpg_real carry[CPG_COMPONENTS];   /* of the state's rounding errors */
#ifdef CPG_PHASE_READOUT
    cpg_real clocks[6][CPG_CELLS];
#endif
#endif
} cpg_track;

#ifdef CPG_STEERING
/* Strides of the legs, then the pace, on the way to their targets. */
typedef struct {
    cpg_real now[CPG_LEGS + 1], rate[CPG_LEGS + 1], target[CPG_LEGS + 1];
    uint8_t at_once;
} cpg_smoother;
#endif

@RAMP@
typedef struct cpg {
    cpg_real position[CPG_JOINTS];  /* rad, leg by leg */
    cpg_real velocity[CPG_JOINTS];  /* rad/s */
    cpg_real level;                 /* 0 at the stand, 1 in the full gait */
    uint8_t held;                   /* joints that a limit held back in this tick */
    /* Private: the fields below are for the functions alone. */
    uint8_t tracks, waiting, followed;
    uint8_t behind[CPG_JOINTS];
    cpg_track track[CPG_TRACKS];
    cpg_ramp ramp;
    cpg_real slowing, slower, frequency, transition;
    cpg_real last_rate[CPG_JOINTS];
#ifdef CPG_STEERING
    cpg_smoother strides;
#endif
} cpg;

/* Stand, every joint at its offset, then go into a gait within ramp s. */
void cpg_start(cpg *c, uint8_t gait, cpg_real ramp);

/* Advance by dt s and fill position and velocity. A negative dt and NaN count as 0, and more than
 * 1 s as 1 s. */
void cpg_advance(cpg *c, cpg_real dt);

/* Change to a gait by a cross-fade of transition s. If all tracks are taken, the gait waits and
 * replaces one that already waits. An unknown gait changes nothing. */
void cpg_switch(cpg *c, uint8_t gait, cpg_real transition);

/* Ramp into the gait (1), or down to the stand (0), within a time in s. */
void cpg_enable(cpg *c, uint8_t enabled, cpg_real ramp);

#ifdef CPG_STEERING
/* Change the strides of the legs, -1 to 1, an array of CPG_LEGS, and the pace, 0 to 2: factors of
 * the gait's own. NaN changes nothing. */
void cpg_steer(cpg *c, const cpg_real *stride, cpg_real pace);
#endif

/* Return the phases of the legs, CPG_LEGS of them, in cycles; 0 is where the leg's cell peaks. */
const cpg_real *cpg_leg_phases(const cpg *c);

#ifndef CPG_TABLE
/* Change the newest gait's delay, model time, from now on: from 1 to CPG_MAX_DELAY steps. */
void cpg_set_delay(cpg *c, cpg_real delay);

/* Start a network from a constant past, and take one step of it: for tests. */
void cpg_network_hold(cpg_track *t, uint8_t gait, const cpg_real *x);
void cpg_network_step(cpg_track *t);
#endif

#ifdef CPG_INTERNAL
/* Constants are in flash memory where that is an address space of its own. */
#if defined(__AVR__)
#ifdef __STRICT_ANSI__
#error "compile with -std=gnu99 or later, as the Arduino IDE does: -std=c99 leaves out __flash"
#endif
#define CPG_ROM const __flash
#else
#define CPG_ROM const
#endif

typedef struct {
    cpg_real frequency;           /* strides per second */
    cpg_real period;              /* model time */
    cpg_real start;               /* phase of the first leg at the orbit's phase 0 */
    cpg_real shift[CPG_JOINTS];   /* from the stand to where the gait swings about, rad */
    cpg_real speed[CPG_JOINTS];   /* largest of the gait, rad/s */
#ifdef CPG_TABLE
    cpg_real joint_phase[CPG_JOINTS];
    cpg_real leg_phase[CPG_LEGS];
    uint8_t joint_table[CPG_JOINTS];
    int16_t points;
    CPG_ROM cpg_real *tables;     /* [table][point]: angle, rad, and its slope per point */
#else
    cpg_real p[CPG_PARAMETERS];
    cpg_real gain, delay;
    int16_t basis_rows, points;
    CPG_ROM cpg_real *basis;      /* rows of CPG_COMPONENTS, of the subspace the lock leaves */
    CPG_ROM cpg_real *waves;      /* [wave][variable][point]: value, and its slope per point */
    cpg_real phase[CPG_CELLS];    /* cycles */
    uint8_t wave[CPG_CELLS];
    cpg_real weights[CPG_JOINTS][CPG_WEIGHTS];
#ifdef CPG_STEERING
    cpg_real in_place[CPG_JOINTS][CPG_WEIGHTS];  /* for strides of length 0 */
#endif
#ifdef CPG_RETIMED
    cpg_real maps[CPG_MAPS][3];   /* k, centre and own: the duty factor's map of a phase */
#endif
#ifdef CPG_PHASE_READOUT
    CPG_ROM cpg_real *shapes;     /* [wave]: mean and half range of both variables */
    CPG_ROM cpg_real *circles;    /* [wave]: first harmonics over their mean square */
    CPG_ROM cpg_real *terms;      /* [wave][harmonic]: cosine and sine term */
    CPG_ROM cpg_real *crests;     /* [wave]: phase at which x peaks */
#else
    cpg_real peak;
    CPG_ROM cpg_real *phase_offset;        /* phase minus angle, over the angle */
#ifdef CPG_RETIMED
    CPG_ROM cpg_real *phase_offset_slope;  /* the same and its slope per point */
    CPG_ROM cpg_real *cycle;      /* x, its slope per point, y and its slope, over the phase */
#endif
#endif
#endif
} cpg_gait;

extern CPG_ROM cpg_gait cpg_gaits[CPG_GAITS];
#define gait_of(t) (&cpg_gaits[(t)->gait])
#define TRACK(n) (&c->track[n])
#ifdef CPG_STEERING
#define STEERED(c) 1
#define STRIDES(c) (&(c)->strides)
#define LEGS_OF(c) CPG_LEGS
extern CPG_ROM uint8_t cpg_joint_leg[CPG_JOINTS];
#else
#define speed_of(c, t, joint, frequency) ((t)->d_angle_d_phase[joint] * (frequency))
#endif
extern CPG_ROM cpg_real cpg_offset[CPG_JOINTS];
extern CPG_ROM cpg_real cpg_limits[3][CPG_JOINTS];  /* lowest, highest, fastest */
#ifndef CPG_TABLE
extern CPG_ROM uint8_t cpg_joint_cell[CPG_JOINTS];
extern CPG_ROM uint8_t cpg_leg_cell[CPG_LEGS];
#endif
#endif

#ifdef __cplusplus
}
#endif

#endif
