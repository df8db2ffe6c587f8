
#define SHORTEST R(0.05)
/* Longest ramp or fade, and longest tick, s. */
#define LONGEST R(3600.0)
#define LONGEST_TICK R(1.0)
#define SHIFTING R(2.0)
#define SHORT_OF R(0.997)
#define ABOVE R(1.000000001)
#define FADES (CPG_TRACKS > 1)

/* Smooth step from 0 to 1, 3 s^2 - 2 s^3, and its derivative. */
static cpg_real smoothstep(cpg_real s, cpg_real *rate)
{
    *rate = R(6.0) * s * (R(1.0) - s);
    return s * s * (R(3.0) - R(2.0) * s);
}

/* Plan the level's way to its end from its present value and rate, without overshoot. */
static void ramp_to(cpg *c, cpg_real end, cpg_real time)
{
    cpg_real level = c->level, rate = c->level_rate;
    c->ramp_parts = 0;
    c->ramp_past = R(0.0);
    if (rate * (end - level) < R(0.0)) {
        /* Turned round half way: brake first, within half of the room that is left. */
        const cpg_real turn = level + R(0.5) * ((rate > R(0.0) ? R(1.0) : R(0.0)) - level);
        const cpg_ramp_part part = {level, rate, turn, R(2.0) * (turn - level) / rate};
        c->ramp[c->ramp_parts++] = part;
        level = turn;
        rate = R(0.0);
    }
    if (rate != R(0.0)) {
        time = least(time, R(3.0) * (end - level) / rate);
    }
    const cpg_ramp_part part = {level, rate, end, time};
    c->ramp[c->ramp_parts++] = part;
}

static void advance_ramp(cpg *c, cpg_real clock)
{
    const cpg_ramp_part part = c->ramp[0];
    c->ramp_past += clock;
    const cpg_real s = part.time > R(0.0) ? c->ramp_past / part.time : R(1.0);
    if (s >= R(1.0)) {
        c->ramp[0] = c->ramp[1];
        c->ramp_parts--;
        c->ramp_past = R(0.0);
        c->level = part.end;
        c->level_rate = R(0.0);
        return;
    }
    cpg_real rate;
    const cpg_real share = smoothstep(s, &rate), left = R(1.0) - s;
    c->level = part.start + share * (part.end - part.start)
             + s * left * left * part.time * part.rate;
    c->level_rate = rate * (part.end - part.start) / part.time
                  + left * (R(1.0) - R(3.0) * s) * part.rate;
}

void cpg_start(cpg *c, uint8_t gait, cpg_real ramp)
{
    if (gait >= CPG_GAITS) {
        gait = 0;
    }
    for (int16_t joint = 0; joint < CPG_JOINTS; joint++) {
        c->position[joint] = cpg_offset[joint];
        c->velocity[joint] = c->last_rate[joint] = R(0.0);
        c->behind[joint] = 0;
    }
    c->held = c->waiting = c->followed = 0;
    c->tracks = 1;
    c->track[0].transition = c->track[0].progress = R(0.0);
    align(&c->track[0], gait, R(0.0));
    c->slowing = c->slower = R(1.0);
    c->frequency = cpg_gaits[gait].frequency;
    c->level = c->level_rate = c->transition = R(0.0);
    ramp_to(c, R(1.0), time_within(ramp, SHORTEST, LONGEST));
}

void cpg_enable(cpg *c, uint8_t enabled, cpg_real ramp)
{
    ramp_to(c, enabled ? R(1.0) : R(0.0), time_within(ramp, SHORTEST, LONGEST));
}

void cpg_switch(cpg *c, uint8_t gait, cpg_real transition)
{
    if (gait < CPG_GAITS) {
        c->waiting = (uint8_t)(gait + 1);
        c->transition = time_within(transition, SHORTEST, LONGEST);
    }
}

const cpg_real *cpg_leg_phases(const cpg *c)
{
    return c->track[c->tracks - 1].legs;
}

static void take_waiting(cpg *c)
{
    if (FADES && c->waiting && c->tracks < CPG_TRACKS) {
        cpg_track *t = &c->track[c->tracks];
        t->transition = c->transition;
        t->progress = R(0.0);
        align(t, (uint8_t)(c->waiting - 1), c->track[c->tracks - 1].phase);
        c->tracks++;
        c->waiting = 0;
    }
}

/* The pattern slows where it would outrun the gaits at the next substep. */
static cpg_real slowed(cpg *c, const cpg_real *rate)
{
    cpg_real worst = R(1.0);
    for (int16_t joint = 0; joint < CPG_JOINTS; joint++) {
        cpg_real bound = R(0.0);
        for (int16_t n = 0; n < c->tracks; n++) {
            CPG_ROM cpg_gait *gait = &cpg_gaits[c->track[n].gait];
            bound = most(bound, gait->speed[joint] + SHIFTING * F(fabs)(gait->shift[joint]));
        }
        bound = most(SHORT_OF * least(bound, cpg_limits[2][joint]), R(1e-9));
        const cpg_real ahead = c->followed ? R(2.0) * rate[joint] - c->last_rate[joint]
                                           : rate[joint];
        worst = most(worst, F(fabs)(ahead) / bound);
        c->last_rate[joint] = rate[joint];
    }
    c->followed = 1;
    return R(1.0) / worst;
}

/* One part of a tick in which gaits fade or the ramp moves. */
static void part_of_tick(cpg *c, cpg_real dt, cpg_real *wanted, cpg_real *rate)
{
    const cpg_real clock = R(0.5) * dt * (c->slowing + c->slower);
    const uint8_t moving = c->tracks > 1 || c->ramp_parts > 0;
    cpg_real share[CPG_TRACKS] = {R(0.0)}, share_rate[CPG_TRACKS] = {R(0.0)};
    cpg_real frequency = cpg_gaits[c->track[0].gait].frequency;
    c->slowing = c->slower;
    for (int16_t n = 1; FADES && n < c->tracks; n++) {
        cpg_track *t = &c->track[n];
        t->progress = least(R(1.0), t->progress + clock / t->transition);
        share[n] = smoothstep(t->progress, &share_rate[n]);
        share_rate[n] /= t->transition;
        frequency += share[n] * (cpg_gaits[t->gait].frequency - frequency);
    }
    const cpg_real strides = R(0.5) * (c->frequency + frequency) * clock;
    c->frequency = frequency;
    for (int16_t n = 0; n < c->tracks; n++) {
        move(&c->track[n], strides);
    }
    const uint8_t faded = c->tracks;
    if (c->ramp_parts > 0) {
        advance_ramp(c, clock);
    }
    for (int16_t joint = 0; joint < CPG_JOINTS; joint++) {
        cpg_real angle = c->track[0].angle[joint], speed = c->track[0].rise[joint] * frequency;
        for (int16_t n = 1; FADES && n < faded; n++) {
            const cpg_track *t = &c->track[n];
            speed += share[n] * (t->rise[joint] * frequency - speed)
                   + share_rate[n] * (t->angle[joint] - angle);
            angle += share[n] * (t->angle[joint] - angle);
        }
        rate[joint] = c->level * speed + c->level_rate * angle;
        wanted[joint] = c->level * angle + cpg_offset[joint];
    }
    while (FADES && c->tracks > 1 && c->track[1].progress >= R(1.0)) {
        for (int16_t n = 1; FADES && n < c->tracks; n++) {
            c->track[n - 1] = c->track[n];
        }
        c->tracks--;
    }
    if (moving) {
        c->slower = slowed(c, rate);
        for (int16_t joint = 0; joint < CPG_JOINTS; joint++) {
            rate[joint] *= c->slowing;
        }
    } else {
        c->slowing = c->slower = R(1.0);
        c->followed = 0;
    }
}

/* One gait, at the stand or in full swing: nothing to mix. */
static void cruise(cpg *c, cpg_real dt, cpg_real *wanted, cpg_real *rate)
{
    cpg_track *t = &c->track[0];
    const cpg_real frequency = cpg_gaits[t->gait].frequency;
    c->slowing = c->slower = R(1.0);
    c->followed = 0;
    move(t, R(0.5) * (c->frequency + frequency) * dt);
    c->frequency = frequency;
    const cpg_real speed = c->level * frequency;
    for (int16_t joint = 0; joint < CPG_JOINTS; joint++) {
        wanted[joint] = t->angle[joint] * c->level + cpg_offset[joint];
        rate[joint] = t->rise[joint] * speed;
    }
}

/* Move joints to where they are wanted within their limits. Where a limit bites, and where a joint
 * catches up, velocity is the difference quotient: it stays the derivative of the position. */
static void confine(cpg *c, cpg_real dt, const cpg_real *wanted, const cpg_real *wanted_rate)
{
    c->held = 0;
    for (int16_t joint = 0; joint < CPG_JOINTS; joint++) {
        const cpg_real last = c->position[joint], fastest = cpg_limits[2][joint];
        const cpg_real reach = fastest * dt * ABOVE;
        cpg_real position = within(wanted[joint], last - reach, last + reach);
        position = within(position, cpg_limits[0][joint], cpg_limits[1][joint]);
        cpg_real rate = wanted_rate[joint];
        /* NaN is held back, too. */
        const uint8_t held = !(position <= wanted[joint] && position >= wanted[joint]);
        const uint8_t fast = F(fabs)(rate) > fastest * ABOVE;
        if (held || fast || c->behind[joint]) {
            rate = dt > R(0.0) ? (position - last) / dt : R(0.0);
            c->held = (uint8_t)(c->held + (held || fast));
        }
        c->behind[joint] = held;
        c->position[joint] = position;
        c->velocity[joint] = within(rate, -fastest, fastest);
    }
}

void cpg_advance(cpg *c, cpg_real dt)
{
    cpg_real wanted[CPG_JOINTS], rate[CPG_JOINTS];
    dt = time_within(dt, R(0.0), LONGEST_TICK);
    take_waiting(c);
    if (c->tracks == 1 && c->ramp_parts == 0) {
        cruise(c, dt, wanted, rate);
    } else {
        const cpg_real parts = most(R(1.0), F(ceil)(dt / CPG_SUBSTEP - R(1e-4)));
        for (cpg_real n = R(0.0); n < parts; n += R(1.0)) {
            part_of_tick(c, dt / parts, wanted, rate);
        }
    }
    confine(c, dt, wanted, rate);
}
