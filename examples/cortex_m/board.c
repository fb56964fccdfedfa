/* Board support of a Cortex-M4F without an operating system: vectors, memory, floating-point unit, 1 kHz timer.
 *
 * The board is the mps2-an386 of QEMU with a clock of 25 MHz. After 3000 steps, the program prints one line (number of
 * steps, number of late steps, results) and stops. On a real target, the loop would continue.
 */
#include "loop.h"

extern uint32_t data_from[], data_begin[], data_end[], zero_begin[], zero_end[], stack_top[];

#define COPROCESSORS (*(volatile uint32_t *)0xE000ED88u)
#define TICK_CONTROL (*(volatile uint32_t *)0xE000E010u)
#define TICK_RELOAD (*(volatile uint32_t *)0xE000E014u)
#define TICKS_A_STEP 25000u
#define STEPS 3000u

static volatile uint32_t steps, late, running;

static int32_t call_host(int32_t operation, const void *argument)
{
    register int32_t r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

static void show(uint32_t value, char after)
{
    char text[10];
    for (int i = 0; i < 8; i++) text[i] = "0123456789abcdef"[(value >> (28 - 4 * i)) & 15u];
    text[8] = after;
    text[9] = '\0';
    (void)call_host(0x04, text);
}

static void leave(uint32_t reason)
{
    (void)call_host(0x18, (const void *)(uintptr_t)reason);
    for (;;) {}
}

static void fault(void) { leave(0x20023u); }

/* Handle the timer interrupt every millisecond. A step is late if the timer expires again before the step ends. */
static void tick(void)
{
    if (running == 0u || steps >= STEPS) return;
    (void)TICK_CONTROL; /* Reading this register clears its flag that the timer has expired. */
    loop_step();
    if ((TICK_CONTROL & 0x10000u) != 0u) late++;
    steps++;
}

void reset(void);

void reset(void)
{
    uint32_t shown[LOOP_SHOWN];
    COPROCESSORS |= 0xFu << 20;
    __asm__ volatile("dsb\n isb");
    for (uint32_t *from = data_from, *to = data_begin; to < data_end;) *to++ = *from++;
    for (uint32_t *to = zero_begin; to < zero_end;) *to++ = 0u;
    loop_begin();
    running = 1u;
    TICK_RELOAD = TICKS_A_STEP - 1u;
    TICK_CONTROL = 7u; /* Start the timer with the processor clock and with its interrupt. */
    while (steps < STEPS) __asm__ volatile("wfi");
    TICK_CONTROL = 0u;
    loop_end(shown);
    show(steps, ' ');
    show(late, ' ');
    for (int i = 0; i < LOOP_SHOWN; i++) show(shown[i], i + 1 < LOOP_SHOWN ? ' ' : '\n');
    leave(0x20026u);
}

__attribute__((section(".vectors"), used)) static const struct {
    const void *stack;
    void (*handler[15])(void); /* The last handler belongs to the timer. */
} vectors = {stack_top, {reset, fault, fault, fault, fault, fault, 0, 0, 0, 0, fault, fault, 0, fault, tick}};
