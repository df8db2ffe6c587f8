
/* Put a gait on its orbit, the first leg at a phase. */
static void align(cpg_track *t, uint8_t gait, cpg_real phase)
{
    const cpg_real ahead = fraction(phase - cpg_gaits[gait].start);
    seed(t, gait, ahead);
    begin_clocks(t, ahead);
    look(t, R(0.0));
    t->phase = t->legs[0];
    t->phase_carry = R(0.0);
}

static void move(cpg_track *t, cpg_real strides)
{
    run(t, strides * gait_of(t)->period);
    look(t, strides);
    const cpg_real expected = t->phase + strides;
    const cpg_real error = fraction(t->legs[0] - expected + R(0.5)) - R(0.5);
    /* The clock follows the network's own phase within two strides. */
    t->phase = turned(t->phase, strides + least(R(1.0), R(0.5) * strides) * error,
                      &t->phase_carry);
}

void cpg_set_delay(cpg *c, cpg_real delay)
{
    cpg_track *t = &c->track[c->tracks - 1];
    t->delay = within(delay / CPG_STEP, R(1.0), CPG_MAX_DELAY);
    restart(t);
}
