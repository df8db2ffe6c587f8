/* What a thread that ticks does at each tick, outside the interpreter: it waits for the deadline,
 * writes numbers into serialised messages and hands these to the middleware. Nothing here
 * allocates memory, and no lock is held but those of the middleware. See native.py. */
#define _POSIX_C_SOURCE 200809L
#include <errno.h>
#include <stddef.h>
#include <stdint.h>
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
