/* Hints about memory, for which Fortran has no words. They change nothing but the time that a run takes. */
#include <stdint.h>
#ifdef __linux__
#include <linux/mman.h>
#include <sys/mman.h>
#endif

void prefetch_line(const void *address) { __builtin_prefetch(address); }

/* Where the system has no huge pages, or none to spare, nothing happens. */
void advise_huge_pages(const void *address, int64_t bytes)
{
#ifdef MADV_COLLAPSE
    const uintptr_t size = 1 << 21;
    uintptr_t from = ((uintptr_t)address + size - 1) / size * size;
    uintptr_t to = ((uintptr_t)address + bytes) / size * size;
    if (to <= from) return;
    madvise((void *)from, to - from, MADV_HUGEPAGE);
    madvise((void *)from, to - from, MADV_COLLAPSE);
#else
    (void)address, (void)bytes;
#endif
}
