/* Memory services that Fortran lacks: hints, which affect only the speed and the memory use of a run, and a message
   when memory runs out. All of it depends on the compiler, the linker and the system. Without MEMORY_HINTS (see HINTS
   in the Makefile) this file does nothing, and the compiler's own message answers a failed `allocate`. */
#include <stdint.h>

#ifdef MEMORY_HINTS
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#ifdef __linux__
#include <malloc.h>
#include <sys/mman.h>
#endif

#define PREFETCH(address) __builtin_prefetch(address)

static const size_t line = 64, large = 128*1024, page = 2*1024*1024;

/* Checks the result of every allocation, explicit or of a temporary array. If there is no memory left, it prints one
   line and ends the program with the exit code for files and system. Data already committed to files stay valid. */
static void *obtained(void *memory, size_t bytes)
{
    if (!memory && bytes) {
        char text[240];
        snprintf(text, sizeof text, "%sout of memory: there is no room for %zu bytes; use fewer disks or a smaller "
                 "starting file, or raise the limit of memory (ulimit -v, batch job)\n",
                 isatty(STDERR_FILENO) == 1 ? "\r\033[K" : "", bytes);
        (void)!write(STDERR_FILENO, text, strlen(text));
        _exit(3);
    }
    return memory;
}

/* Aligns large arrays to cache lines, so that a record of 64 bytes occupies a single line. Arrays of at least 2 MB are
   placed on huge pages if the system offers them, because the TLB covers few pages. The linker redirects malloc here
   (--wrap=malloc), because `allocate` has no control over alignment or page size. */
void *__real_malloc(size_t bytes);
__attribute__((used)) void *__wrap_malloc(size_t bytes)
{
    void *memory;
    if (bytes < large) return obtained(__real_malloc(bytes), bytes);
    if (posix_memalign(&memory, bytes < page ? line : page, bytes)) memory = NULL;
#ifdef MADV_HUGEPAGE
    if (memory && bytes >= page) madvise(memory, bytes / page * page, MADV_HUGEPAGE);
#endif
    return obtained(memory, bytes);
}

void *__real_realloc(void *memory, size_t bytes);
__attribute__((used)) void *__wrap_realloc(void *memory, size_t bytes)
{
    return obtained(__real_realloc(memory, bytes), bytes);
}

/* Fixes the size above which arrays are mapped and unmapped. By default the C library raises this size with use; large
   arrays that are allocated again and again can then end up behind each other, and the heap of a long run grows without
   end. The shared library leaves the size alone: its heap belongs to the program that has loaded it. */
#if defined(M_MMAP_THRESHOLD) && (defined(__PIE__) || !defined(__PIC__))
__attribute__((constructor, used)) static void map_large_arrays(void)
{
    mallopt(M_MMAP_THRESHOLD, (int)large);
}
#endif

#else
#define PREFETCH(address) ((void)(address))
#endif

void prefetch_integer(const int32_t *item) { PREFETCH(item); }

void prefetch_real(const double *item) { PREFETCH(item); }
