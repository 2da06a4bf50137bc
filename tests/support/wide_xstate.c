/* For user-mode Linux 6.1 on processors with AMX: preloaded into linux.uml by vcan.sh.
 *
 * That kernel keeps the floating-point registers of its processes in 2,696 bytes, which hold everything up to AVX-512 and
 * PKRU. Where the processor has AMX the host takes no other size than its own (11,008 bytes there) when it is asked to set
 * them (PTRACE_SETREGSET, EFAULT), and the kernel dies of its first process. Tiles need a permission that no process here
 * asks for, so what is left out is always empty. The layout is that of XSAVE: Intel SDM volume 1, 13.4.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <elf.h>
#include <errno.h>
#include <stdarg.h>
#include <stdint.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/uio.h>

enum { ALL_BYTES = 65536, STATES_AT = 512 };
static const uint64_t TILES = UINT64_C(3) << 17;

long ptrace(enum __ptrace_request request, ...)
{
    static long (*system_ptrace)(enum __ptrace_request, ...);
    static _Alignas(64) unsigned char whole[ALL_BYTES]; /* one kernel is one thread */
    if (!system_ptrace)
        *(void **)&system_ptrace = dlsym(RTLD_NEXT, "ptrace");

    va_list arguments;
    va_start(arguments, request);
    const int pid = va_arg(arguments, int);
    void *const address = va_arg(arguments, void *);
    void *const data = va_arg(arguments, void *);
    va_end(arguments);
    if (request != PTRACE_SETREGSET || (uintptr_t)address != NT_X86_XSTATE)
        return system_ptrace(request, pid, address, data);

    struct iovec host = {.iov_base = whole, .iov_len = sizeof whole};
    const struct iovec *const kernel = data;
    if (system_ptrace(PTRACE_GETREGSET, pid, address, &host) < 0)
        return -1;
    if (kernel->iov_len >= host.iov_len)
        return system_ptrace(request, pid, address, data);
    memset(whole, 0, host.iov_len);
    memcpy(whole, kernel->iov_base, kernel->iov_len);
    uint64_t states;
    memcpy(&states, whole + STATES_AT, sizeof states);
    states &= ~TILES;
    memcpy(whole + STATES_AT, &states, sizeof states);
    return system_ptrace(request, pid, address, &host);
}
