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
/* Return codes of rcl: the time to wait is over, and no message waits. */
#define TIMED_OUT 2
#define NOTHING_TAKEN 401
#define OUTPUTS 4

/* CLOCK_TIMEOUT: longest time for which /clock is waited for before requests are looked at;
 * MAX_CLOCK_STEP: step of simulated time that is not a stall, as /clock may be coarse or lose a
 * message; MAX_CLOCK_JITTER: step back above which it is a jump: after a smaller one (messages out
 * of order, two publishers of /clock) ticks wait until time is past its last value; STOP_TIMEOUT:
 * time by the steady clock after which a stop no longer waits for a still /clock; all in ns. */
#define CLOCK_TIMEOUT 20000000
#define MAX_CLOCK_STEP 50000000
#define MAX_CLOCK_JITTER 100000000
#define STOP_TIMEOUT 200000000

/* Same layout as rcutils_uint8_array_t. */
typedef struct {
    uint8_t *buffer;
    size_t length, capacity;
    void *allocator[5];
} serialized;

typedef struct {
    /* rcl_publish_serialized_message */
    int32_t (*send)(const void *publisher, const serialized *message, void *allocation);
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
static int64_t wait_until(int64_t deadline)
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
    int32_t attend;                /* set by other threads: Python is to prepare the next tick */
    int32_t stopping;              /* set by other threads: ticks do not wait for /clock */
} counters;

typedef struct {
    block *to;
    const double *const *const *from;  /* addresses of the pointers to the numbers of each part */
    const int64_t *sizes;
    int64_t parts;
    int64_t every, since;              /* ticks between two messages, and since the last */
    int64_t quiet;                     /* only while the first number is not 1, and as it changes */
    const double *while_not_0;         /* publish only while this is not 0; NULL for always */
    double first;
} output;

/* An input: a topic, and where numbers are in its messages. */
typedef struct {
    const void *subscription;
    serialized message;        /* the last one taken */
    const uint8_t *sample;     /* one of the same layout */
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

/* The correction of the angles between plan and move of the pattern; where these are NULL, close
 * moves the joints itself. */
typedef struct {
    int64_t (*close)(const void *arguments);
    int64_t (*finish)(const void *arguments);  /* called after move; NULL for nothing to do */
    const void *arguments;     /* replaced when gains change */
    void (*report)(const void *what, double *numbers, int64_t *gaits);
    void (*plan)(void *what, double dt);
    void (*move)(void *what, double dt, int corrected);
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

/* Return the stamp at which a message begins, ns. */
static int64_t stamp_of(const uint8_t *data, int swapped)
{
    int32_t seconds = 0;
    uint32_t nanoseconds = 0;
    number(data + 4, swapped, &seconds, 4);
    number(data + 8, swapped, &nanoseconds, 4);
    return (int64_t)seconds * SECOND + nanoseconds;
}

/* Tell whether a message has another byte order than this machine: 0 as its second byte is
 * big-endian. */
static int is_swapped(const uint8_t *data)
{
    const uint16_t one = 1;
    return (data[1] & 1) != *(const uint8_t *)&one;
}

/* Read a message; return 0, and mark it, if it is of another layout than is known. */
int read_input(input *in, const uint8_t *data, int64_t length)
{
    in->unread = in->length < 0 ? length < -in->length : length != in->length;
    for (int64_t k = 0; k < in->ranges && !in->unread; k++) {
        const int64_t from = in->same[k][0];
        in->unread = memcmp(data + from, in->sample + from, (size_t)(in->same[k][1] - from)) != 0;
    }
    if (in->unread) {
        return 0;
    }
    const int swapped = is_swapped(data);
    int changed = 0;
    for (int64_t k = 0; k < in->count; k++) {
        double value;
        number(data + in->place[k] + (in->place[k] < 0 ? length : 0), swapped, &value, 8);
        changed |= memcmp(&value, &in->values[k], sizeof value) != 0;
        in->values[k] = value;
    }
    const int64_t stamp = in->stamped ? stamp_of(data, swapped) : 0;
    *in->stamp = stamp ? 1e-9 * (double)stamp : NAN;
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
    const void *arguments = __atomic_load_n(&c->arguments, __ATOMIC_ACQUIRE);
    c->numbers[0] = dt;
    c->numbers[1] = 1e-9 * (double)stamp;
    if (c->plan) {
        c->plan(what, dt);
        c->report(what, c->numbers + 2, c->gaits);
    }
    if (c->close(arguments) == 2) {
        for (int64_t k = 0; k < c->parts; k++) {
            memcpy(c->resets[k].to, c->resets[k].from, (size_t)c->resets[k].size);
        }
    }
    if (c->plan) {
        c->move(what, dt, 1);
    }
    if (c->finish) {
        c->finish(arguments);
    }
}

/* Simulated time. */
typedef struct {
    const void *subscription;          /* of /clock */
    void *set;                         /* rcl_wait_set_t with room for it */
    int (*clear)(void *set);
    int (*add)(void *set, const void *subscription, size_t *index);
    int (*wait)(void *set, int64_t timeout);
    int (*take)(const void *subscription, void *message, void *info, void *allocation);
    void (*forget)(void);
    serialized message;
    int64_t time, step;                /* the latest, and the step to it, ns; 0 before the first */
    int64_t moved;                     /* when it came, by the steady clock, ns */
    int64_t deadline;                  /* by the steady clock, 0 while ticks go by /clock */
} simulated;

/* What run leaves to Python: to prepare the next tick, to resume after a stall, a tick, to start
 * again where simulated time jumps back, to report an error of the middleware. */
enum { ATTEND = 1, RESUME, TICK, RESTART, REFUSED };

typedef struct {
    counters *count;
    const int32_t *attend;             /* set by the pattern if Python is to prepare the next tick */
    void (*advance)(void *what, double dt);    /* NULL where Python ticks */
    void (*resume)(void *what, double stall);  /* s; NULL where Python does it */
    void *what;
    int64_t deadline, period, stall;   /* ns; stall: delay from which on ticks are left out */
    int64_t stamp, behind;             /* of the tick, and how late it is, ns */
    int64_t (*offset)(void);           /* system time minus steady time, ns */
    simulated *clock;                  /* NULL for the steady clock */
    correction *correct;               /* NULL for none */
    output *outputs[OUTPUTS];          /* NULL behind the last one */
    int32_t due;                       /* whether a tick is due */
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
    if ((o->quiet && !changed && first == 1.0) || (o->while_not_0 && *o->while_not_0 == 0.0)) {
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

/* Publish what is due at a tick; return 0 if the middleware refuses a message. */
static int publish_outputs(loop *l)
{
    int sent = 1;
    for (int k = 0; k < OUTPUTS && l->outputs[k] && sent; k++) {
        sent = put(l->outputs[k], l->stamp, l->period);
    }
    return sent;
}

/* Do a tick of the loop's stamp; return 0 if the middleware refuses a message. */
int tick(loop *l)
{
    const double dt = 1e-9 * (double)l->period;
    if (l->correct) {
        correct(l->correct, l->what, dt, l->stamp);
    } else {
        l->advance(l->what, dt);
    }
    return publish_outputs(l);
}

static int is_attended(const loop *l)
{
    return __atomic_load_n(&l->count->attend, __ATOMIC_ACQUIRE)
        || (l->attend && __atomic_load_n(l->attend, __ATOMIC_ACQUIRE));
}

/* Leave out the ticks that a stall has cost, and the one after it: that keeps ticks apart. Where
 * every sleep is longer than a stall, some remain. Return whether that one is left out. */
static int leave_out(loop *l, int64_t *deadline)
{
    counters *count = l->count;
    const int64_t missed = l->behind / l->period;
    count->resuming = !count->resuming;
    count->dropped += missed + count->resuming;
    *deadline += missed * l->period;
    if (l->resume) {
        l->resume(l->what, 1e-9 * (double)l->behind);
    }
    return count->resuming;
}

/* Wait for the next deadline by the steady clock; return what is left to Python, or 0. */
static int by_steady_clock(loop *l, int64_t *deadline)
{
    counters *count = l->count;
    l->behind = wait_until(*deadline + l->period);
    if (is_attended(l)) {
        return ATTEND;
    }
    *deadline += l->period;
    count->worst = l->behind > count->worst ? l->behind : count->worst;
    const int stalled = l->behind >= l->stall;
    if (stalled) {
        l->due = !leave_out(l, deadline);
    } else {
        l->due = 1;
        count->resuming = 0;
    }
    count->late += l->due && l->behind > l->period;
    return stalled && !l->resume ? RESUME : 0;
}

/* Wait for a message of /clock; return its time, ns, or 0 if none comes within CLOCK_TIMEOUT. */
static int64_t read_clock(simulated *c)
{
    int error = c->clear(c->set);
    error = error ? error : c->add(c->set, c->subscription, NULL);
    error = error ? error : c->wait(c->set, CLOCK_TIMEOUT);
    if (error && error != TIMED_OUT) {
        c->forget();
        wait_until(steady_time() + CLOCK_TIMEOUT);
    }
    int64_t time = 0;
    while (!(error = c->take(c->subscription, &c->message, NULL, NULL))) {
        time = stamp_of(c->message.buffer, is_swapped(c->message.buffer));
    }
    if (error != NOTHING_TAKEN) {
        c->forget();
    }
    return time;
}

/* Take over a time of /clock, ns; return what is left to Python, or 0. */
static int take_time(loop *l, int64_t now)
{
    simulated *c = l->clock;
    const int64_t back = c->time - now, usual = c->step;
    if (!c->time || back > 0) {
        const int event = c->time ? RESTART : 0;
        l->deadline = c->time = now;
        c->step = 0;
        return event;
    }
    /* A clock may be coarser than a period; a stall is a step unlike the one before. */
    c->step = now - c->time;
    c->time = now;
    l->behind = now - l->deadline - l->period;
    if (l->behind < l->stall || c->step <= 2 * usual || c->step <= MAX_CLOCK_STEP) {
        return 0;
    }
    l->deadline += leave_out(l, &l->deadline) ? l->period : 0;
    return l->resume ? 0 : RESUME;
}

/* Wait for the next deadline by /clock; return what is left to Python, or 0. */
static int by_clock(loop *l)
{
    simulated *c = l->clock;
    for (;;) {
        const int stopping = __atomic_load_n(&l->count->stopping, __ATOMIC_ACQUIRE);
        if (is_attended(l)) {
            return ATTEND;
        }
        if (c->deadline && stopping) {
            const int64_t before = c->deadline;
            const int event = by_steady_clock(l, &c->deadline);
            l->deadline += c->deadline - before;
            return event;
        }
        if (c->deadline) {
            /* The next time counts, whatever it is. */
            c->deadline = c->time = 0;
            c->moved = steady_time();
        }
        if (l->deadline && l->deadline + l->period <= c->time) {
            l->deadline += l->period;
            l->due = 1;
            return 0;
        }
        const int64_t now = read_clock(c), back = c->time - now;
        if (now > c->time) {
            c->moved = steady_time();
        } else if (stopping && l->deadline
                   && ((now && back > MAX_CLOCK_JITTER)
                       || steady_time() >= c->moved + STOP_TIMEOUT)) {
            c->deadline = steady_time();
            continue;
        }
        if (now && !(back >= 0 && back <= MAX_CLOCK_JITTER)) {
            const int event = take_time(l, now);
            if (event) {
                return event;
            }
        }
    }
}

/* Tick until something is left to Python; return what. */
int run(loop *l)
{
    for (;;) {
        if (!l->due) {
            const int event = l->clock ? by_clock(l) : by_steady_clock(l, &l->deadline);
            if (event) {
                return event;
            }
            if (!l->due) {
                continue;
            }
        }
        if (l->correct && !sense(l->correct)) {
            return ATTEND;
        }
        l->due = 0;
        l->count->ticks++;
        l->stamp = l->deadline + (l->clock ? 0 : l->offset());
        if (!l->advance) {
            return TICK;
        }
        if (!tick(l)) {
            return REFUSED;
        }
    }
}
