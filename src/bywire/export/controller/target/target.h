/* Services for a harness on a Cortex-M: semihosting output, a clock, and the stack depth. */
#ifndef BYWIRE_TARGET_H
#define BYWIRE_TARGET_H

#include <stdint.h>

#define STACK_PAINT 0xA5A5A5A5u
#define CLOCK_TOP 0xFFFFFFu
#define INSIDE static inline __attribute__((always_inline))
/* The compiler must not move memory accesses across this point. */
#define IN_ORDER() __asm__ volatile("" ::: "memory")

extern uint32_t stack_low[], stack_top[];

void say(const char *text);
void say_number(uint32_t value);
void leave(int status) __attribute__((noreturn));

/* SysTick is a 24-bit counter that counts down, here once every 40 instructions. QEMU runs one
 * instruction per nanosecond of its own time (-icount shift=0), and these boards have a 25 MHz clock. */
#define INSTRUCTIONS_PER_COUNT 40u
#define SYST_CSR (*(volatile uint32_t *)0xE000E010u)
#define SYST_RVR (*(volatile uint32_t *)0xE000E014u)
#define SYST_CVR (*(volatile uint32_t *)0xE000E018u)

INSIDE uint32_t counted_since(uint32_t before) { return (before - SYST_CVR) & CLOCK_TOP; }

INSIDE uint32_t *stack_pointer(void)
{
    uint32_t *here;
    __asm__ volatile("mov %0, sp" : "=r"(here));
    return here;
}

INSIDE void paint_stack(void)
{
    volatile uint32_t *const end = stack_pointer();
    for (volatile uint32_t *at = stack_low; at < end; ++at) *at = STACK_PAINT;
}

/* Return the number of bytes below the caller's stack that were used since the stack was painted. */
INSIDE uint32_t stack_used(void)
{
    const volatile uint32_t *const end = stack_pointer();
    const volatile uint32_t *at = stack_low;
    while (at < end && *at == STACK_PAINT) ++at;
    return 4u * (uint32_t)(end - at);
}

#endif
