/* Startup code of a Cortex-M without an operating system, and its output to the emulator
 * (semihosting). */
#include "target.h"

int main(void);

static int semihosting(int operation, const void *block)
{
    register int r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = block;
    __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

void say(const char *text) { (void)semihosting(0x04, text); }

void say_number(uint32_t value)
{
    char text[11];
    int at = 10;
    text[at] = '\0';
    do {
        text[--at] = (char)('0' + value % 10u);
        value /= 10u;
    } while (value != 0u);
    say(text + at);
}

void leave(int status)
{
    const uint32_t block[2] = {0x20026u, (uint32_t)status}; /* ADP_Stopped_ApplicationExit */
    (void)semihosting(0x20, block);
    for (;;) {}
}

static void fault(void)
{
    say("fault\n");
    leave(3);
}

void reset(void)
{
#if defined(__ARM_FP)
    *(volatile uint32_t *)0xE000ED88u |= 0xFu << 20; /* CPACR: enable the floating-point unit */
    __asm__ volatile("dsb\n\tisb");
#endif
    SYST_RVR = CLOCK_TOP;
    SYST_CVR = 0u;
    SYST_CSR = 5u; /* enabled, driven by the processor's clock */
    leave(main());
}

typedef void (*Handler)(void);

__attribute__((section(".vectors"), used)) static const Handler vectors[16] = {
    (Handler)stack_top, reset, fault, fault, fault, fault, fault, 0,
    0, 0, 0, fault, fault, 0, fault, fault,
};
