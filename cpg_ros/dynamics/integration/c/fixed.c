#define CPG_INTERNAL
#include "cpg.h"

/* Shares, levels and clocks have 14 bits after the point, sums over ticks 30. */
#define ONE 16384
#define WHOLE 1073741824

/* a >> bits, at most 16 of them, without a loop over bits on processors that have no such shift.
 * */
static int16_t down(int32_t a, uint8_t bits)
{
    return (int16_t)((int16_t)(a >> 16) * (int16_t)(1 << (16 - bits)) + ((uint16_t)a >> bits));
}

/* a q, q with 14 bits after the point. */
static int16_t part(int16_t a, int16_t q)
{
    return down((int32_t)a * q + ONE / 2, 14);
}

/* Return a share of 14 bits as one of 16 bits, in which 1 becomes the largest number. */
static uint16_t finer(int16_t share)
{
    return share < ONE ? (uint16_t)((uint16_t)share * 4U) : UINT16_MAX;
}

/* a q, q with 16 bits after the point. */
static int16_t share_of(int16_t a, uint16_t q)
{
    return (int16_t)(((int32_t)a * (int32_t)q) >> 16);
}

static int32_t scaled(int32_t a, int16_t q)
{
    return (int32_t)(int16_t)(a >> 16) * q * 4 + (((int32_t)(uint16_t)a * q) >> 14);
}

/* Return the share per tick that adds up to 1 in a number of ticks. */
static int32_t step_of(uint16_t ticks)
{
    return WHOLE / (ticks > CPG_SHORTEST ? ticks : CPG_SHORTEST);
}

/* Return the share per tick with which a level covers a distance, 2^-14, at a rate. */
static int32_t step_over(int32_t rate, int32_t way)
{
    const int32_t quotient = rate / way, most = step_of(0) / ONE;
    return (quotient < most ? quotient : most) * ONE;
}

/* A periodic table of 256 entries at a phase, with lines in between. */
static int16_t lookup(CPG_ROM int16_t *table, uint16_t phase)
{
    const uint8_t low = (uint8_t)(phase >> 8);
    const int16_t a = table[low], b = table[(uint8_t)(low + 1)];
    return (int16_t)(a + (((int32_t)(int16_t)(b - a) * (uint8_t)phase) >> 8));
}

/* Smooth step from 0 to 1, 3 s^2 - 2 s^3, and its derivative. */
static int16_t smoothstep(int16_t s, int16_t *rate)
{
    const int16_t square = part(s, s), left = (int16_t)(ONE - s);
    *rate = (int16_t)(6 * part(s, left));
    return (int16_t)(square + 2 * part(square, left));
}

/* Plan the path of the level from its present value and rate to its end, without overshoot. */
static void ramp_to(cpg *c, int16_t end, uint16_t ticks)
{
    int16_t level = c->level;
    int32_t rate = c->level_rate, step = step_of(ticks);
    c->ramp_parts = 0;
    c->ramp_past = 0;
    if ((rate > 0 && end < level) || (rate < 0 && end > level)) {
        /* The level moves away from its end: brake first, within half of the room that is left. */
        const int16_t room = (int16_t)(((rate > 0 ? ONE : 0) - level) / 2);
        if (room != 0) {
            const cpg_ramp_part first = {level, (int16_t)(level + room),
                                         (int16_t)(2 * (int32_t)room / 3),
                                         step_over(rate, 2 * (int32_t)room)};
            c->ramp[c->ramp_parts++] = first;
            level = first.end;
        }
        rate = 0;
    }
    const int32_t room = (int32_t)end - level;
    int32_t kick = rate / (step / ONE) / 3;
    if (rate != 0 && room != 0 && (room > 0 ? kick > room : kick < room)) {
        kick = room;
        step = step_over(rate, 3 * room);
    }
    const cpg_ramp_part last = {level, end, (int16_t)kick, step};
    c->ramp[c->ramp_parts++] = last;
}

static void advance_ramp(cpg *c, int16_t clock)
{
    const cpg_ramp_part now = c->ramp[0];
    const int16_t way = (int16_t)(now.end - now.start);
    c->ramp_past += scaled(now.step, clock);
    if (c->ramp_past >= WHOLE) {
        c->ramp[0] = c->ramp[1];
        c->ramp_parts--;
        c->ramp_past = 0;
        c->level = now.end;
        c->level_rate = 0;
        return;
    }
    int16_t rate;
    const int16_t s = (int16_t)(c->ramp_past >> 16), left = (int16_t)(ONE - s);
    const int16_t share = smoothstep(s, &rate), kick = part(left, now.kick);
    c->level = (int16_t)(now.start + part(way, share) + 3 * part(part(left, s), kick));
    c->level_rate = scaled(now.step, part(rate, way))
                  + 3 * scaled(now.step, part((int16_t)(ONE - 3 * s), kick));
}

static void align(cpg_track *t, uint8_t gait, uint32_t phase)
{
    t->gait = gait;
    t->progress = 0;
    t->phase = phase - cpg_gaits[gait].start;
}

void cpg_start(cpg *c, uint8_t gait, uint16_t ramp)
{
    if (gait >= CPG_GAITS) {
        gait = 0;
    }
    for (uint8_t joint = 0; joint < CPG_JOINTS; joint++) {
        c->position[joint] = cpg_joints[joint].offset;
    }
    c->held = c->waiting = c->followed = 0;
    c->tracks = 1;
    align(&c->track[0], gait, 0);
    c->slowing = c->slower = ONE;
    c->frequency = cpg_gaits[gait].frequency;
    c->level = 0;
    c->level_rate = c->transition = 0;
    ramp_to(c, ONE, ramp);
}

void cpg_enable(cpg *c, uint8_t enabled, uint16_t ramp)
{
    ramp_to(c, enabled ? ONE : 0, ramp);
}

void cpg_switch(cpg *c, uint8_t gait, uint16_t transition)
{
    if (gait < CPG_GAITS) {
        c->waiting = (uint8_t)(gait + 1);
        c->transition = step_of(transition);
    }
}

uint16_t cpg_leg_phase(const cpg *c, uint8_t leg)
{
    const cpg_track *t = &c->track[c->tracks - 1];
    return (uint16_t)((t->phase >> 16) + cpg_gaits[t->gait].leg_phase[leg < CPG_LEGS ? leg : 0]);
}

/* Move a joint by an angle of the pattern, within its limits. */
static void move(cpg *c, uint8_t joint, int16_t angle)
{
    CPG_ROM cpg_joint *of = &cpg_joints[joint];
    const int16_t last = c->position[joint], low = of->low, high = of->high;
    const uint16_t reach = of->reach;
    const int16_t wanted = (int16_t)(of->offset + ((angle + (1 << CPG_FINE) / 2) >> CPG_FINE));
    int16_t position = wanted < low ? low : wanted > high ? high : wanted;
    if (position > last) {
        if ((uint16_t)(position - last) > reach) {
            position = (int16_t)(last + (int16_t)reach);
        }
    } else if ((uint16_t)(last - position) > reach) {
        position = (int16_t)(last - (int16_t)reach);
    }
    if (position != wanted) {
        c->held++;
    }
    c->position[joint] = position;
}

/* A joint's angle in a gait. */
static int16_t angle_of(CPG_ROM cpg_gait_joint *of, uint16_t phase)
{
    return (int16_t)(of->shift + lookup(of->table, (uint16_t)(phase + of->phase)));
}

/* The same, and its rate at a frequency. */
static int16_t read_joint(CPG_ROM cpg_gait_joint *of, uint16_t phase, uint16_t frequency,
                          int16_t *rate)
{
    CPG_ROM int16_t *table = of->table;
    phase = (uint16_t)(phase + of->phase);
    *rate = share_of(lookup(table + 256, phase), frequency);
    return (int16_t)(of->shift + lookup(table, phase));
}

/* Compute a tick of one gait, at the stand or in full swing. */
static void cruise(cpg *c)
{
    cpg_track *t = &c->track[0];
    CPG_ROM cpg_gait *gait = &cpg_gaits[t->gait];
    c->slowing = c->slower = ONE;
    c->followed = 0;
    c->frequency = gait->frequency;
    t->phase += (uint32_t)gait->frequency;
    const uint16_t phase = (uint16_t)(t->phase >> 16), level = finer(c->level);
    for (uint8_t joint = 0; joint < CPG_JOINTS; joint++) {
        const int16_t angle = angle_of(&gait->joint[joint], phase);
        move(c, joint, c->level == ONE ? angle : share_of(angle, level));
    }
}

/* A product as a rate; rates beyond these limits are slowed as much as rates at them. */
static int16_t rate_of(int32_t product)
{
    const int16_t most = 1 << (CPG_TERM_BITS - 3), high = (int16_t)(product >> 16);
    return high >= most ? 8191 : high < -most ? -8192 : down(product, CPG_TERM_BITS);
}

/* Compute a tick in which gaits fade or the ramp moves. */
static void blend(cpg *c)
{
    const int16_t clock = (int16_t)((uint16_t)(c->slowing + (uint16_t)c->slower) / 2);
    cpg_track *first = &c->track[0], *second = &c->track[1];
    CPG_ROM cpg_gait *from = &cpg_gaits[first->gait], *to = from;
    const uint8_t fading = c->tracks > 1;
    int32_t frequency = from->frequency;
    int16_t share = 0, share_rate = 0;
    c->slowing = c->slower;
    if (fading) {
        to = &cpg_gaits[second->gait];
        second->progress += scaled(second->step, clock);
        second->progress = second->progress < WHOLE ? second->progress : WHOLE;
        share = smoothstep((int16_t)(second->progress >> 16), &share_rate);
        share_rate = (int16_t)(scaled(second->step, share_rate) >> (30 - CPG_SHARE_BITS));
        frequency += scaled(to->frequency - frequency, share);
    }
    const int32_t strides = scaled(c->frequency + (frequency - c->frequency) / 2, clock);
    c->frequency = frequency;
    first->phase += (uint32_t)strides;
    second->phase += (uint32_t)strides;
    if (c->ramp_parts > 0) {
        advance_ramp(c, clock);
    }
    const uint16_t pace = (uint16_t)(frequency >> CPG_FREQUENCY_BITS);
    const uint16_t level = finer(c->level), faded = finer(share);
    const uint8_t ramping = c->level < ONE || c->level_rate != 0;
    const int16_t level_rate = (int16_t)(c->level_rate >> (30 - CPG_SHARE_BITS));
    const uint16_t phase = (uint16_t)(first->phase >> 16);
    const uint16_t other_phase = (uint16_t)(second->phase >> 16);
    uint16_t worst = 1, worst_bound = 1;
    for (uint8_t joint = 0; joint < CPG_JOINTS; joint++) {
        CPG_ROM cpg_gait_joint *of = &from->joint[joint];
        int16_t speed, angle = read_joint(of, phase, pace, &speed);
        uint16_t bound = of->bound;
        if (fading) {
            of = &to->joint[joint];
            int16_t other_speed;
            const int16_t way = (int16_t)(read_joint(of, other_phase, pace, &other_speed) - angle);
            const int16_t gap = (int16_t)(other_speed - speed);
            const uint16_t other_bound = of->bound;
            speed = (int16_t)(speed + share_of(gap, faded) + rate_of((int32_t)share_rate * way));
            angle = (int16_t)(angle + share_of(way, faded));
            bound = other_bound > bound ? other_bound : bound;
        }
        if (ramping) {
            speed = (int16_t)(share_of(speed, level) / 2 + rate_of((int32_t)level_rate * angle) / 2);
            speed = (int16_t)((speed > 8191 ? 8191 : speed < -8191 ? -8191 : speed) * 2);
            angle = share_of(angle, level);
        }
        move(c, joint, angle);
        /* Slow the clock if a joint would exceed its speed bound in the next tick. */
        const int16_t last = c->followed ? c->last_rate[joint] : speed;
        const int16_t half = (int16_t)(speed - (last >> 1));
        const uint16_t size = (uint16_t)((uint16_t)(half < 0 ? -half : half) * 2U);
        c->last_rate[joint] = speed;
        if (size > bound && (uint32_t)size * worst_bound > (uint32_t)worst * bound) {
            worst = size;
            worst_bound = bound;
        }
    }
    c->followed = 1;
    c->slower = ONE;
    if (worst > worst_bound) {
        c->slower = (int16_t)((uint32_t)worst_bound * ONE / worst);
    }
    if (fading && second->progress == WHOLE) {
        *first = *second;
        c->tracks = 1;
    }
}

void cpg_advance(cpg *c)
{
    c->held = 0;
    if (CPG_GAITS > 1 && c->waiting && c->tracks == 1) {
        CPG_ROM cpg_gait *gait = &cpg_gaits[c->track[0].gait];
        align(&c->track[1], (uint8_t)(c->waiting - 1), c->track[0].phase + gait->start);
        c->track[1].step = c->transition;
        c->tracks = 2;
        c->waiting = 0;
    }
    if (c->tracks == 1 && c->ramp_parts == 0) {
        cruise(c);
    } else {
        blend(c);
    }
}
