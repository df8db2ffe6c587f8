
/* Every node has both slopes. */
static const cpg_real *arriving(const cpg_track *t, int16_t node)
{
    return t->before[node];
}

static void begin_kink(cpg_track *t)
{
    (void)t;
}

static void end_kink(cpg_track *t, int16_t node)
{
    memcpy(t->before[node], t->slope[node], sizeof *t->before);
}
