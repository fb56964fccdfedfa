/* Start-up code of a Cortex-M4F or M7 in QEMU: vectors, memory, floating-point unit, semihosting calls. */
#include <stdint.h>

#include "board.h"

extern uint32_t data_from[], data_begin[], data_end[], zero_begin[], zero_end[], stack_top[], stack_end[];

#define COPROCESSORS (*(volatile uint32_t *)0xE000ED88u)
#define TICK_CONTROL (*(volatile uint32_t *)0xE000E010u)
#define TICK_RELOAD (*(volatile uint32_t *)0xE000E014u)
#define TICK_NOW (*(volatile uint32_t *)0xE000E018u)
#define PAINT 0xA5A5A5A5u

static int32_t call_host(int32_t operation, const void *argument)
{
    register int32_t r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

void board_put(const char *text) { (void)call_host(0x04, text); }

/* Return the ticks of the system timer, which counts down in 24 bits. */
uint32_t board_ticks(void) { return 0xFFFFFFu - TICK_NOW; }

/* Return the number of stack bytes that have been written so far. */
uint32_t board_stack(void)
{
    const uint32_t *p = stack_end;
    while (*p == PAINT) p++;
    return (uint32_t)(stack_top - p) * 4u;
}

static void leave(uint32_t reason)
{
    (void)call_host(0x18, (const void *)(uintptr_t)reason);
    for (;;) {}
}

static void fault(void) { leave(0x20023u); } /* QEMU ends with a run-time error. */

void reset(void);

void reset(void)
{
    COPROCESSORS |= 0xFu << 20;
    __asm__ volatile("dsb\n isb");
    for (uint32_t *p = stack_end, *sp = (uint32_t *)__builtin_frame_address(0) - 16; p < sp; p++) *p = PAINT;
    for (uint32_t *from = data_from, *to = data_begin; to < data_end;) *to++ = *from++;
    for (uint32_t *to = zero_begin; to < zero_end;) *to++ = 0u;
    TICK_RELOAD = 0xFFFFFFu;
    TICK_CONTROL = 5u; /* processor clock, no interrupt */
    leave(replay() == 0 ? 0x20026u : 0x20023u);
}

__attribute__((section(".vectors"), used)) static void (*const vectors[16])(void) = {
    (void (*)(void))stack_top, reset, fault, fault, fault, fault, fault};
