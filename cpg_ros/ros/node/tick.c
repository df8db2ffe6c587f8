/* What a thread that ticks does at each tick, outside the interpreter: it waits for the deadline,
 * writes numbers into serialised messages and hands these to the middleware. Nothing here
 * allocates memory, and no lock is held but those of the middleware. See native.py. */
#define _POSIX_C_SOURCE 200809L
#include <errno.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <time.h>

#define SECOND 1000000000

/* As rcutils_uint8_array_t. */
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
    uint32_t *words;        /* stamp, duration, and the numbers: what changes */
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
} output;

typedef struct {
    counters *count;
    const int32_t *asked;              /* by what advances, for a tick of Python's */
    void (*advance)(void *what, double dt);
    void (*resume)(void *what, double stall);  /* s */
    void *what;
    int64_t deadline, period, stall;   /* ns */
    output *outputs[2];
} loop;

/* System time minus steady time, ns, of the narrowest of some readings. */
static int64_t system_offset(void)
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
    if (++o->since < o->every) {
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
        l->advance(l->what, 1e-9 * (double)l->period);
        const int64_t stamp = l->deadline + system_offset();
        if (!(put(l->outputs[0], stamp, l->period) & put(l->outputs[1], 0, 0))) {
            count->wanted = 1;
        }
    }
}
