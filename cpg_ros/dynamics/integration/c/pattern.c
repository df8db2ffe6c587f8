
/* RAMP_SPEED: joint speed allowed in ramps and fades, 1/s, per rad from the stand to the gait's
 * mean.
 * SPEED_MARGIN: fraction of the speed bound up to which the clock lets joints go.
 * ROUNDING_FACTOR: factor of the speed limit that absorbs rounding, so that a joint at it is not
 * held back.
 * STEP_TOLERANCE: how far a step may be outside of the velocities at its ends, over the speed
 * limit.
 * FADES: whether two gaits can fade into each other. */
#define RAMP_SPEED R(2.0)
#define SPEED_MARGIN R(0.997)
#define ROUNDING_FACTOR R(1.000000001)
#define STEP_TOLERANCE R(0.05)
#define FADES (CPG_TRACKS > 1)

/* Smooth step from 0 to 1, 3 s^2 - 2 s^3, and its derivative. */
static cpg_real smoothstep(cpg_real s, cpg_real *rate)
{
    *rate = R(6.0) * s * (R(1.0) - s);
    return s * s * (R(3.0) - R(2.0) * s);
}

/* Plan the path of a level from its present value and rate to its end, without overshoot. */
static void ramp_to(cpg_ramp *ramp, cpg_real end, cpg_real time)
{
    cpg_real level = ramp->level, rate = ramp->rate;
    ramp->parts = 0;
    ramp->past = R(0.0);
    if (rate * (end - level) < R(0.0)) {
        /* The level moves away from its end: brake first, within half of the room that is left. */
        const cpg_real halt = level + R(0.5) * ((rate > R(0.0) ? R(1.0) : R(0.0)) - level);
        const cpg_ramp_part part = {level, rate, halt, R(2.0) * (halt - level) / rate};
        ramp->parts = 1;
        ramp->part = part;
        level = halt;
        rate = R(0.0);
    }
    if (rate != R(0.0)) {
        /* The path does not overshoot if it takes no longer than this. */
        time = least(time, R(3.0) * (end - level) / rate);
    }
    if (ramp->parts) {
        ramp->end = end;
        ramp->time = time;
    } else {
        const cpg_ramp_part part = {level, rate, end, time};
        ramp->part = part;
    }
    ramp->parts++;
}

/* Value and rate at a fraction s of the duration of a path that ends at rest. */
static cpg_real come_to_rest(const cpg_ramp_part *way, cpg_real s, cpg_real *rate)
{
    cpg_real slope;
    const cpg_real weight = smoothstep(s, &slope), left = R(1.0) - s;
    *rate = slope * (way->end - way->start) / way->time + left * (R(1.0) - R(3.0) * s) * way->rate;
    return way->start + weight * (way->end - way->start) + s * left * left * way->time * way->rate;
}

static void advance_ramp(cpg_ramp *ramp, cpg_real clock)
{
    cpg_ramp_part *part = &ramp->part;
    ramp->past += clock;
    const cpg_real s = part->time > R(0.0) ? ramp->past / part->time : R(1.0);
    if (s >= R(1.0)) {
        ramp->level = part->start = part->end;
        ramp->rate = part->rate = ramp->past = R(0.0);
        part->end = ramp->end;
        part->time = ramp->time;
        ramp->parts--;
        return;
    }
    ramp->level = come_to_rest(part, s, &ramp->rate);
}

/* Factor of the clock, 0 to 1, at which no joint exceeds its speed bound in the next substep. */
static cpg_real slowed(cpg *c, const cpg_real *rate, uint8_t approaching)
{
    (void)approaching;
    cpg_real worst = R(1.0);
    for (int16_t joint = 0; joint < CPG_JOINTS; joint++) {
        cpg_real bound = R(0.0);
        for (int16_t n = 0; n < c->tracks; n++) {
            CPG_ROM cpg_gait *gait = gait_of(TRACK(n));
            bound = most(bound, gait->speed[joint] + RAMP_SPEED * F(fabs)(gait->shift[joint]));
        }
#ifdef CPG_HOST
        bound += approaching ? RAMP_SPEED * fabs(c->found[joint]) : 0.0;
#endif
        bound = most(SPEED_MARGIN * least(bound, cpg_limits[2][joint]), R(1e-9));
        const cpg_real ahead = c->followed ? R(2.0) * rate[joint] - c->last_rate[joint]
                                           : rate[joint];
        worst = most(worst, F(fabs)(ahead) / bound);
        c->last_rate[joint] = rate[joint];
    }
    c->followed = 1;
    return R(1.0) / worst;
}

/* Compute one substep of a tick in which gaits fade or the ramp moves. */
static void part_of_tick(cpg *c, cpg_real dt, cpg_real *wanted, cpg_real *rate)
{
    const cpg_real clock = R(0.5) * dt * (c->slowing + c->slower);
    uint8_t moving = c->tracks > 1 || c->ramp.parts > 0, approaching = 0;
    cpg_real weight[CPG_TRACKS] = {R(0.0)}, weight_rate[CPG_TRACKS] = {R(0.0)};
    cpg_real frequency = gait_of(TRACK(0))->frequency;
    c->slowing = c->slower;
    for (int16_t n = 1; FADES && n < c->tracks; n++) {
        cpg_track *t = TRACK(n);
        t->progress = least(R(1.0), t->progress + clock / t->transition);
        weight[n] = smoothstep(t->progress, &weight_rate[n]);
        weight_rate[n] /= t->transition;
        frequency += weight[n] * (gait_of(t)->frequency - frequency);
    }
#ifdef CPG_STEERING
    /* Strides change by the slowed clock, as all that makes up the rates does. */
    frequency *= steered(c, clock);
#endif
#ifdef CPG_HOST
    approaching = c->approach.parts > 0;
    moving = moving || approaching;
#endif
    const cpg_real strides = R(0.5) * (c->frequency + frequency) * clock;
    c->frequency = frequency;
    for (int16_t n = 0; n < c->tracks; n++) {
#ifdef CPG_HOST
        if (!move(TRACK(n), strides)) {
            recover(c, TRACK(n));
        }
#else
        move(TRACK(n), strides);
#endif
    }
#ifdef CPG_HOST
    /* Go to the stand first: the gait swings about it, not about where the joints were found. */
    if (approaching) {
        advance_ramp(&c->approach, clock);
    } else
#endif
    if (c->ramp.parts > 0) {
        advance_ramp(&c->ramp, clock);
    }
    for (int16_t joint = 0; joint < CPG_JOINTS; joint++) {
        cpg_real angle = TRACK(0)->angle[joint], speed = speed_of(c, TRACK(0), joint, frequency);
        for (int16_t n = 1; FADES && n < c->tracks; n++) {
            const cpg_track *t = TRACK(n);
            speed += weight[n] * (speed_of(c, t, joint, frequency) - speed)
                   + weight_rate[n] * (t->angle[joint] - angle);
            angle += weight[n] * (t->angle[joint] - angle);
        }
        rate[joint] = c->ramp.level * speed + c->ramp.rate * angle;
        wanted[joint] = c->ramp.level * angle + cpg_offset[joint];
#ifdef CPG_HOST
        if (approaching) {
            wanted[joint] += c->approach.level * c->found[joint];
            rate[joint] += c->approach.rate * c->found[joint];
        }
#endif
    }
    while (FADES && c->tracks > 1 && TRACK(1)->progress >= R(1.0)) {
        for (int16_t n = 1; FADES && n < c->tracks; n++) {
            c->track[n - 1] = c->track[n];
        }
        c->tracks--;
    }
    if (moving) {
        c->slower = slowed(c, rate, approaching);
        for (int16_t joint = 0; joint < CPG_JOINTS; joint++) {
            rate[joint] *= c->slowing;
        }
    } else {
        c->slowing = c->slower = R(1.0);
        c->followed = 0;
    }
}

/* Compute a tick of one gait, at the stand or in full swing. Return 0, and fill nothing, if the
 * network left its orbit. */
static uint8_t cruise(cpg *c, cpg_real dt, cpg_real *wanted, cpg_real *rate)
{
    cpg_track *t = TRACK(0);
    cpg_real frequency = gait_of(t)->frequency;
    c->slowing = c->slower = R(1.0);
    c->followed = 0;
#ifdef CPG_STEERING
    frequency *= steered(c, dt);
#endif
    const cpg_real strides = R(0.5) * (c->frequency + frequency) * dt;
    c->frequency = frequency;
#ifdef CPG_HOST
    if (!move(t, strides)) {
        t->phase -= strides;
        return 0;
    }
#else
    move(t, strides);
#endif
#ifndef CPG_STEERING
    frequency *= c->ramp.level;
#endif
    for (int16_t joint = 0; joint < CPG_JOINTS; joint++) {
        wanted[joint] = t->angle[joint] * c->ramp.level + cpg_offset[joint];
        rate[joint] = speed_of(c, t, joint, frequency);
#ifdef CPG_STEERING
        rate[joint] *= c->ramp.level;
#endif
    }
    return 1;
}

/* Move joints to where they are wanted within their limits. Where a limit bites, where a joint
 * catches up, and where a step is outside of the velocities at both its ends, since a network turns
 * within a tick, velocity is the difference quotient: it stays the derivative of the position. */
static void confine(cpg *c, cpg_real dt, const cpg_real *wanted, const cpg_real *wanted_rate)
{
    c->held = 0;
    for (int16_t joint = 0; joint < CPG_JOINTS; joint++) {
        const cpg_real last = c->position[joint], fastest = cpg_limits[2][joint];
        const cpg_real reach = fastest * dt * ROUNDING_FACTOR;
        cpg_real position = within(wanted[joint], last - reach, last + reach);
        position = within(position, cpg_limits[0][joint], cpg_limits[1][joint]);
        cpg_real rate = wanted_rate[joint];
        /* NaN is held back, too. */
        const uint8_t held = !(position <= wanted[joint] && position >= wanted[joint]);
        const uint8_t fast = F(fabs)(rate) > fastest * ROUNDING_FACTOR;
        uint8_t turned = 0;
#ifdef CPG_HOST
        const cpg_real before = c->velocity[joint], step = dt > 0.0 ? (position - last) / dt : 0.0;
        turned = fabs(step - within(step, least(rate, before), most(rate, before)))
               > STEP_TOLERANCE * fastest;
#endif
        if (held || fast || turned || c->behind[joint]) {
            rate = dt > R(0.0) ? (position - last) / dt : R(0.0);
            c->held = (uint8_t)(c->held + (held || fast));
        }
        c->behind[joint] = held;
        c->position[joint] = position;
        c->velocity[joint] = within(rate, -fastest, fastest);
    }
}
