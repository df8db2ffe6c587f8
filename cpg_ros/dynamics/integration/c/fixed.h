/* @TITLE@
 *
 * In whole numbers. cpg_start once, then cpg_advance CPG_RATE times a second: the position of
 * every joint. Between ticks cpg_switch changes the gait and cpg_enable ramps to the stand and
 * back. Nothing here allocates memory, calls itself or waits; a struct cpg holds all that changes.
 */
#ifndef CPG_H
#define CPG_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define CPG_FIXED
#define CPG_TABLE
@DEFINES@

/* A time in s as ticks; a position in rad, and in tenths of degrees. */
#define CPG_TICKS(seconds) (!((seconds) > 0) ? (uint16_t)0 : (seconds) * CPG_RATE < 65534.0 \
                            ? (uint16_t)((seconds) * CPG_RATE + 0.5) : (uint16_t)65535)
#define CPG_RADIANS(position) ((position) / 8192.0)
#define CPG_TENTHS(position) ((int16_t)(((int32_t)(position) * 2292 + 16384) >> 15))

typedef struct {
    uint8_t gait;
    uint32_t phase;                /* of the orbit, 2^-32 cycles */
    int32_t progress, step;        /* share of a fade that is over, and that of a tick, 2^-30 */
} cpg_track;

typedef struct {
    int16_t start, end, kick;      /* levels, 2^-14; a third of the rate at its start */
    int32_t step;                  /* share of a tick, 2^-30 */
} cpg_ramp_part;

typedef struct cpg {
    int16_t position[CPG_JOINTS];  /* 2^-13 rad, leg by leg */
    int16_t level;                 /* 0 at the stand, 2^14 in the full gait */
    uint8_t held;                  /* joints that a limit held back in this tick */
    /* Private: the fields below are for the functions alone. */
    uint8_t tracks, ramp_parts, waiting, followed;
    cpg_track track[2];
    cpg_ramp_part ramp[2];
    int32_t ramp_past, level_rate, frequency, transition;
    int16_t slowing, slower;
    int16_t last_rate[CPG_JOINTS];
} cpg;

/* Stand, every joint at its offset, then go into a gait within ramp ticks. */
void cpg_start(cpg *c, uint8_t gait, uint16_t ramp);

/* Advance by a tick and fill position. */
void cpg_advance(cpg *c);

/* Change to a gait by a cross-fade of transition ticks. While gaits fade, the gait waits and
 * replaces one that already waits. An unknown gait changes nothing. */
void cpg_switch(cpg *c, uint8_t gait, uint16_t transition);

/* Ramp into the gait (1), or down to the stand (0), within ramp ticks. */
void cpg_enable(cpg *c, uint8_t enabled, uint16_t ramp);

/* Return the phase of a leg, 2^-16 cycles, 0 where the leg's cell peaks; the first leg's for an
 * unknown leg. */
uint16_t cpg_leg_phase(const cpg *c, uint8_t leg);

#ifdef CPG_INTERNAL
/* Constants are in flash memory where that is an address space of its own. */
#if defined(__AVR__)
#define CPG_ROM const __flash
#else
#define CPG_ROM const
#endif

typedef struct {
    int16_t shift;           /* from the stand to where the gait swings about */
    uint16_t bound;          /* largest rate in a fade, in units of rates */
    uint16_t phase;          /* 2^-16 cycles */
    CPG_ROM int16_t *table;  /* 256 angles over a cycle, 256 slopes */
} cpg_gait_joint;

typedef struct {
    int32_t frequency;       /* 2^-32 strides a tick */
    uint32_t start;          /* phase of the first leg at the orbit's phase 0 */
    uint16_t leg_phase[CPG_LEGS];
    cpg_gait_joint joint[CPG_JOINTS];
} cpg_gait;

typedef struct {
    int16_t offset, low, high;
    uint16_t reach;          /* largest change in a tick */
} cpg_joint;

extern CPG_ROM cpg_gait cpg_gaits[CPG_GAITS];
extern CPG_ROM cpg_joint cpg_joints[CPG_JOINTS];
#endif

#ifdef __cplusplus
}
#endif

#endif
