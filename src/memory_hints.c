/* Hints about memory, for which Fortran has no words. They change nothing but the time that a run takes. */
#include <stdint.h>
#include <stdlib.h>
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

/* Large arrays begin with a cache line, so that each record of the size of a line lies on one only. The linker leads
   all that asks for memory here (--wrap=malloc), as `allocate` has no word for that, either. */
void *__real_malloc(size_t bytes);
__attribute__((used)) void *__wrap_malloc(size_t bytes)
{
    const size_t line = 64, large = 128*1024;
    return bytes < large || bytes > PTRDIFF_MAX ? __real_malloc(bytes) : aligned_alloc(line, (bytes + line - 1) / line * line);
}
