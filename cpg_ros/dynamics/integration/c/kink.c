
/* Return the slope that arrives at a node, which differs from the one that leaves it only where
 * parameters have changed. */
static const cpg_real *arriving(const cpg_track *t, int16_t node)
{
    return node == t->kink ? t->before : t->slope[node];
}

/* Keep the slope that arrives at the head node, which is about to get another that leaves it. */
static void begin_kink(cpg_track *t)
{
    if (t->kink != t->head) {
        for (int16_t i = 0; i < CPG_COMPONENTS; i++) {
            t->before[i] = t->slope[t->head][i];
        }
        t->kink = t->head;
    }
}

/* A new node has one slope. */
static void end_kink(cpg_track *t, int16_t node)
{
    if (t->kink == node) {
        t->kink = -1;
    }
}
