typedef struct {
    cpg_real start, rate, end, time;
} cpg_ramp_part;

/* A level on the way to its target, and its rate, 1/s. */
typedef struct {
    cpg_real level, rate, past;
    cpg_ramp_part part;
    cpg_real end, time;  /* of the part after that, which begins at rest */
    uint8_t parts;
} cpg_ramp;
