/* Count the instructions of ticks and steps on a Cortex-M: SysTick of an MPS2 board runs at 25 MHz,
 * and under qemu -icount shift=0 an instruction takes 1 ns. Results go out by semihosting. */
#include "cpg.h"

extern uint32_t data_begin, data_end, data_load, bss_begin, bss_end;
int main(void);
void reset(void);
__attribute__((section(".vectors"))) const void *const vectors[16] = {
    (void *)0x20100000, (void *)reset, (void *)reset, (void *)reset};

#define FULL 0xFFFFFFu
#define REGISTER(address) (*(volatile uint32_t *)(address))

static void semihost(int operation, const void *argument)
{
    register int r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
}

void reset(void)
{
    uint32_t *from = &data_load;
    for (uint32_t *to = &data_begin; to < &data_end; to++) {
        *to = *from++;
    }
    for (uint32_t *to = &bss_begin; to < &bss_end; to++) {
        *to = 0;
    }
#ifdef __ARM_FP
    REGISTER(0xE000ED88) |= 0xFu << 20;
    __asm__ volatile("dsb\n isb");
#endif
    main();
    semihost(0x18, (void *)0x20026);
}

static void print(const char *name, long value)
{
    char text[16], *place = text + 15;
    unsigned long left = value < 0 ? 0UL - (unsigned long)value : (unsigned long)value;
    *place = 0;
    do {
        *--place = (char)('0' + left % 10);
        left /= 10;
    } while (left);
    if (value < 0) {
        *--place = '-';
    }
    semihost(4, name);
    semihost(4, " ");
    semihost(4, place);
    semihost(4, "\n");
}

static void begin(void)
{
    REGISTER(0xE000E014) = FULL;
    REGISTER(0xE000E018) = 0;
    REGISTER(0xE000E010) = 5;
}

static long instructions(void)
{
    return (long)(FULL - REGISTER(0xE000E018)) * 40;
}

static cpg c;

int main(void)
{
    long cruise = 0, fading = 0;
    cpg_start(&c, 0, (cpg_real)1.0);
    for (int tick = 0; tick < 200; tick++) {
        if (tick == 100) {
            cpg_switch(&c, CPG_GAITS - 1, (cpg_real)1.0);
        }
        begin();
        cpg_advance(&c, (cpg_real)0.02);
        const long taken = instructions();
        long *worst = tick >= 60 && tick < 100 ? &cruise : &fading;
        *worst = taken > *worst ? taken : *worst;
    }
    print("tick", cruise);
    print("fading", fading);
    print("state", (long)sizeof c);
    for (int joint = 0; joint < CPG_JOINTS; joint++) {
        print("position", (long)(c.position[joint] * 1e5f));
    }
#ifndef CPG_TABLE
    begin();
    for (int step = 0; step < 20; step++) {
        cpg_network_step(&c.track[0]);
    }
    print("step", instructions() / 20);
#endif
    return 0;
}
