/* The work of a ticking thread at each tick, outside the interpreter: it waits for the deadline,
 * writes numbers into serialised messages and hands these to the middleware. Nothing here
 * allocates memory, and no lock is held but those of the middleware. See native.py. */
#define _POSIX_C_SOURCE 200809L
#include <errno.h>
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <time.h>

#define SECOND 1000000000
/* Return code of rcl if no message waits. */
#define NOTHING_TAKEN 401
#define OUTPUTS 3

/* Same layout as rcutils_uint8_array_t. */
typedef struct {
    uint8_t *buffer;
    size_t length, capacity;
    void *allocator[5];
} serialized;

typedef struct {
    /* rcl_publish_serialized_message, and rcutils_reset_error. */
    int32_t (*send)(const void *publisher, const serialized *message, void *allocation);
    void (*forget)(void);
    const void *const *publisher;
    const serialized *message;
    uint32_t *memory;       /* of all messages, words */
    uint32_t *words;        /* changing words: stamp, duration, and the numbers */
    const int64_t *place;   /* in the memory, of each word that changes, */
    const int64_t *source;  /* and where it comes from */
    int64_t messages, changes;
} block;

/* Fill all messages and publish them; stamp and duration in ns. Return how many are published:
 * fewer than all if the middleware refuses one. */
int64_t publish(const block *b, int64_t stamp, int64_t duration)
{
    b->words[0] = (uint32_t)(stamp / SECOND);
    b->words[1] = (uint32_t)(stamp % SECOND);
    b->words[2] = (uint32_t)(duration / SECOND);
    b->words[3] = (uint32_t)(duration % SECOND);
    for (int64_t i = 0; i < b->changes; i++) {
        b->memory[b->place[i]] = b->words[b->source[i]];
    }
    for (int64_t i = 0; i < b->messages; i++) {
        if (b->send(b->publisher[i], &b->message[i], NULL)) {
            b->forget();
            return i;
        }
    }
    return b->messages;
}

static int64_t steady_time(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * SECOND + now.tv_nsec;
}

/* Wait until a deadline by the steady clock, ns; return the time since it, ns. */
int64_t wait_until(int64_t deadline)
{
    int64_t behind = steady_time() - deadline;
    if (behind < 0) {
        const struct timespec when = {deadline / SECOND, deadline % SECOND};
        while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &when, NULL) == EINTR) {
        }
        behind = steady_time() - deadline;
    }
    return behind;
}

typedef struct {
    int64_t ticks, late, dropped;  /* how many */
    int64_t worst;                 /* longest delay, ns */
    int32_t resuming;              /* the last tick was left out after a stall */
    int32_t wanted;                /* set by other threads: the next tick is to be Python's */
} counters;

typedef struct {
    block *to;
    const double *const *const *from;  /* addresses of the pointers to the numbers of each part */
    const int64_t *sizes;
    int64_t parts;
    int64_t every, since;              /* ticks between two messages, and since the last */
    int64_t quiet;                     /* only while the first number is not 1, and as it changes */
    double first;
} output;

/* An input: a topic, and where numbers are in its messages. */
typedef struct {
    const void *subscription;
    serialized message;        /* the last one taken */
    const uint8_t *known;      /* one of the same layout */
    const int64_t (*same)[2];  /* bytes, from and to, that are the same in all messages */
    const int64_t *place;      /* first byte of each number; below 0 from the end */
    double *values, *stamp;    /* s; NaN for none */
    int64_t *news;             /* 1: a message with the same numbers has come, 2: with others */
    int64_t ranges, count, depth;
    int64_t length;            /* of messages; below 0 that of the shortest ones */
    int32_t stamped, unread;   /* unread: a message of another layout waits for Python */
} input;

typedef struct {
    void *to;
    const void *from;
    int64_t size;
} copy;

/* The correction of the angles between plan and follow of the pattern. */
typedef struct {
    int64_t (*close)(const void *arguments);
    const void *arguments;     /* replaced when gains change */
    void (*report)(const void *what, double *numbers, int64_t *gaits);
    void (*plan)(void *what, double dt);
    void (*follow)(void *what, double dt, int corrected);
    int (*take)(const void *subscription, void *message, void *info, void *allocation);
    void (*forget)(void);
    double *numbers;           /* length of the tick and time, s, then those of report */
    int64_t *gaits;
    input *inputs;
    const copy *resets;
    int64_t count, parts;
} correction;

/* Copy a number out of a message with its own byte order. */
static void number(const uint8_t *from, int swapped, void *to, int size)
{
    for (int k = 0; k < size; k++) {
        ((uint8_t *)to)[k] = from[swapped ? size - 1 - k : k];
    }
}

/* Read a message; return 0, and mark it, if it is of another layout than is known. */
int read_input(input *in, const uint8_t *data, int64_t length)
{
    in->unread = in->length < 0 ? length < -in->length : length != in->length;
    for (int64_t k = 0; k < in->ranges && !in->unread; k++) {
        const int64_t from = in->same[k][0];
        in->unread = memcmp(data + from, in->known + from, (size_t)(in->same[k][1] - from)) != 0;
    }
    if (in->unread) {
        return 0;
    }
    /* The second byte says so: 0 for big-endian. */
    const uint16_t one = 1;
    const int swapped = (data[1] & 1) != *(const uint8_t *)&one;
    int changed = 0;
    for (int64_t k = 0; k < in->count; k++) {
        double value;
        number(data + in->place[k] + (in->place[k] < 0 ? length : 0), swapped, &value, 8);
        changed |= memcmp(&value, &in->values[k], sizeof value) != 0;
        in->values[k] = value;
    }
    int32_t seconds = 0;
    uint32_t nanoseconds = 0;
    if (in->stamped) {
        number(data + 4, swapped, &seconds, 4);
        number(data + 8, swapped, &nanoseconds, 4);
    }
    *in->stamp = seconds || nanoseconds ? seconds + 1e-9 * nanoseconds : NAN;
    *in->news = 1 + changed;
    return 1;
}

/* Take and read the newest messages; return 0 if Python has to read one. */
int sense(correction *c)
{
    int read = 1;
    for (int64_t k = 0; k < c->count; k++) {
        input *in = &c->inputs[k];
        int came = 0;
        for (int64_t n = 0; n < in->depth; n++) {
            const int error = c->take(in->subscription, &in->message, NULL, NULL);
            if (error) {
                if (error != NOTHING_TAKEN) {
                    c->forget();
                }
                break;
            }
            came = 1;
        }
        if (came) {
            read &= read_input(in, in->message.buffer, (int64_t)in->message.length);
        }
    }
    return read;
}

static void correct(correction *c, void *what, double dt, int64_t stamp)
{
    c->numbers[0] = dt;
    c->numbers[1] = 1e-9 * (double)stamp;
    c->plan(what, dt);
    c->report(what, c->numbers + 2, c->gaits);
    if (c->close(__atomic_load_n(&c->arguments, __ATOMIC_ACQUIRE)) == 2) {
        for (int64_t k = 0; k < c->parts; k++) {
            memcpy(c->resets[k].to, c->resets[k].from, (size_t)c->resets[k].size);
        }
    }
    c->follow(what, dt, 1);
}

typedef struct {
    counters *count;
    const int32_t *asked;              /* set by the pattern if the next tick needs Python */
    void (*advance)(void *what, double dt);
    void (*resume)(void *what, double stall);  /* s */
    void *what;
    int64_t deadline, period, stall;   /* ns */
    correction *correct;               /* NULL for none */
    output *outputs[OUTPUTS];          /* NULL behind the last one */
} loop;

/* Return system time minus steady time, ns, of the narrowest of some readings: a thread switch in
 * between would add its length. */
int64_t system_offset(void)
{
    int64_t narrowest = INT64_MAX, offset = 0;
    for (int n = 0; n < 5 && narrowest > 20000; n++) {
        struct timespec now;
        const int64_t before = steady_time();
        clock_gettime(CLOCK_REALTIME, &now);
        const int64_t width = steady_time() - before;
        if (width < narrowest) {
            narrowest = width;
            offset = (int64_t)now.tv_sec * SECOND + now.tv_nsec - before;
        }
    }
    return offset;
}

static int put(output *o, int64_t stamp, int64_t duration)
{
    const double first = (*o->from[0])[0];
    const int changed = first != o->first;
    o->first = first;
    if (++o->since < o->every && !(o->quiet && changed)) {
        return 1;
    }
    if (o->quiet && !changed && first == 1.0) {
        return 1;
    }
    o->since = 0;
    char *words = (char *)(o->to->words + 4);
    for (int64_t part = 0; part < o->parts; part++) {
        const size_t size = (size_t)o->sizes[part] * sizeof(double);
        memcpy(words, *o->from[part], size);
        words += size;
    }
    return publish(o->to, stamp, duration) == o->to->messages;
}

/* Do a tick of a stamp, ns; return 0 if the middleware refuses a message. */
int tick(loop *l, int64_t stamp)
{
    const double dt = 1e-9 * (double)l->period;
    int sent = 1;
    if (l->correct) {
        correct(l->correct, l->what, dt, stamp);
    } else {
        l->advance(l->what, dt);
    }
    for (int k = 0; k < OUTPUTS && l->outputs[k]; k++) {
        sent &= put(l->outputs[k], stamp, l->period);
    }
    return sent;
}

/* Tick until Python is wanted for a tick: by request, or to report an error of the middleware.
 * Return how long ago the deadline of that tick was, ns. Stalls are left out as Ticker does. */
int64_t run(loop *l)
{
    counters *count = l->count;
    for (;;) {
        l->deadline += l->period;
        const int64_t behind = wait_until(l->deadline);
        if (__atomic_load_n(&count->wanted, __ATOMIC_ACQUIRE)
            || __atomic_load_n(l->asked, __ATOMIC_ACQUIRE)) {
            return behind;
        }
        if (l->correct && !sense(l->correct)) {
            return behind;
        }
        count->worst = behind > count->worst ? behind : count->worst;
        const int stalled = behind >= l->stall;
        const int skip = stalled && !count->resuming;
        count->resuming = skip;
        if (stalled) {
            const int64_t missed = behind / l->period;
            l->resume(l->what, 1e-9 * (double)behind);
            l->deadline += missed * l->period;
            count->dropped += missed + skip;
            if (skip) {
                continue;
            }
        }
        count->late += behind > l->period;
        count->ticks++;
        if (!tick(l, l->deadline + system_offset())) {
            count->wanted = 1;
        }
    }
}
