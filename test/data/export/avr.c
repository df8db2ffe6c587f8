/* Count the cycles of ticks and steps on an ATmega, by a timer at the processor's clock, and the
 * memory that the stack takes. */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <stdio.h>

#include "cpg.h"

#define UNUSED 0xA5

static cpg c;
static volatile uint16_t overflows;
extern uint8_t __heap_start;

ISR(TIMER1_OVF_vect)
{
    overflows++;
}

static int put(char letter, FILE *file)
{
    (void)file;
    while (!(UCSR0A & (1 << UDRE0))) {
    }
    UDR0 = (uint8_t)letter;
    return 0;
}

static FILE serial = FDEV_SETUP_STREAM(put, NULL, _FDEV_SETUP_WRITE);

static void begin(void)
{
    TCNT1 = 0;
    overflows = 0;
}

static uint32_t cycles(void)
{
    return ((uint32_t)overflows << 16) | TCNT1;
}

int main(void)
{
    uint32_t cruise = 0, fading = 0;
    stdout = &serial;
    UCSR0B = 1 << TXEN0;
    TCCR1B = 1;
    TIMSK1 = 1 << TOIE1;
    sei();
    for (uint8_t *byte = &__heap_start; byte < (uint8_t *)SP - 8; byte++) {
        *byte = UNUSED;
    }
    cpg_start(&c, 0, (cpg_real)1.0);
    for (int tick = 0; tick < 200; tick++) {
        if (tick == 100) {
            cpg_switch(&c, CPG_GAITS - 1, (cpg_real)1.0);
        }
        begin();
        cpg_advance(&c, (cpg_real)0.02);
        const uint32_t taken = cycles();
        uint32_t *worst = tick >= 60 && tick < 100 ? &cruise : &fading;
        *worst = taken > *worst ? taken : *worst;
    }
    const uint8_t *byte = &__heap_start;
    while (*byte == UNUSED) {
        byte++;
    }
    printf("tick %lu\n", cruise);
    printf("fading %lu\n", fading);
    printf("state %u\n", (unsigned)sizeof c);
    printf("stack %u\n", (unsigned)(RAMEND - (uint16_t)byte));
    for (int joint = 0; joint < CPG_JOINTS; joint++) {
        printf("position %ld\n", (long)(c.position[joint] * 1e5f));
    }
#ifndef CPG_TABLE
    uint32_t worst = 0;
    for (int step = 0; step < 20; step++) {
        begin();
        cpg_network_step(&c.track[0]);
        const uint32_t taken = cycles();
        worst = taken > worst ? taken : worst;
    }
    printf("step %lu\n", worst);
#endif
    cli();
    sleep_enable();
    sleep_cpu();
}
