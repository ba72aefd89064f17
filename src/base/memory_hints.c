/* What Fortran cannot express about memory: hints, which change nothing but the time and the room that a run takes, and
   an answer when there is none left. Everything here depends on the compiler, the linker and the system; without
   MEMORY_HINTS (see HINTS in the Makefile) nothing is left, and a failed `allocate` is answered by the compiler. */
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

/* The answer to every `allocate`, and to every temporary array, that finds no memory: one line and the exit code of
   files and system. What is committed in files stays as it is. */
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

/* Large arrays start on a cache line, so that a record as long as a line lies in one. Larger ones lie on huge pages, if
   the system has any to spare: the TLB covers few pages. The linker redirects malloc here (--wrap=malloc) because
   `allocate` offers no control over alignment or page size. */
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

/* Large arrays that come and go are mapped and unmapped. Otherwise the C library raises the size from which it does so,
   and each new one may end up behind the last one: the heap of a long run grows without end. Not so in the library: the
   heap there is that of the program that has loaded it. */
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
