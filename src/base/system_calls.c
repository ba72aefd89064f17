/* System calls that need constants, structures or the variable errno from C headers (POSIX, flock, CPU affinity). The
   Fortran interfaces of these functions are in system.f90. After a failure, a function returns -1 and errno
   contains the reason. */
#define _GNU_SOURCE
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <time.h>
#include <unistd.h>

/* --- Clock and signals --- */

double system_seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9*(double)now.tv_nsec;
}

/* All variables written by the signal handler; atomic, because the handler may run in any thread. */
static atomic_int stop_signal, checkpoint_signals;
static _Atomic double first_stop_at;

/* Exit code and message of the program if a stop signal ends it immediately, while no data can be lost. */
static struct {
    atomic_bool at_once;  /* false while data could be lost */
    int code;
    char message[256];
} ending;

static void end_at_once(void)
{
    (void)!write(STDERR_FILENO, ending.message, strlen(ending.message));
    _exit(ending.code);
}

/* Signal handler. While no data can be lost, a stop signal ends the program immediately. Otherwise the first stop signal
   is only recorded, and the main loop ends the run. A second stop signal ends the program immediately if it arrives
   more than half a second after the first; the delay is needed because job launchers often send a signal twice within
   a fraction of a second. */
static void note_signal(int number)
{
    const double moments = 0.5;
    const int kept = errno;
    if (number == SIGUSR1) {
        checkpoint_signals++;
    } else if (ending.at_once) {
        end_at_once();
    } else if (!stop_signal) {
        first_stop_at = system_seconds();
        stop_signal = number;
    } else if (system_seconds() - first_stop_at > moments) {
        signal(number, SIG_DFL);
        raise(number);
    }
    errno = kept;
}

void system_watch_signals(void)
{
    const int watched[] = {SIGHUP, SIGINT, SIGTERM, SIGXCPU, SIGUSR1};
    struct sigaction action = {.sa_handler = note_signal, .sa_flags = SA_RESTART}, previous;
    sigfillset(&action.sa_mask);
    for (size_t k = 0; k < sizeof watched / sizeof *watched; k++)
        if (sigaction(watched[k], NULL, &previous) == 0 && previous.sa_handler != SIG_IGN)
            sigaction(watched[k], &action, NULL);
    signal(SIGXFSZ, SIG_IGN);
}

void system_record_signals(void) { ending.at_once = false; }

/* From this call on, a stop signal ends the program immediately. If a stop signal was recorded earlier, this call ends
   the program. */
void system_end_at_signals(const char *message, int code)
{
    system_record_signals();
    strncpy(ending.message, message, sizeof ending.message - 1);
    ending.code = code;
    ending.at_once = true;
    if (stop_signal) end_at_once();
}

bool system_stop_requested(void) { return stop_signal != 0; }

int system_checkpoint_requests(void) { return checkpoint_signals; }

/* --- Cores and threads --- */

int system_cores(void)
{
#ifdef CPU_COUNT
    cpu_set_t mine;
    if (sched_getaffinity(0, sizeof mine, &mine) == 0) return CPU_COUNT(&mine);
#endif
    return (int)sysconf(_SC_NPROCESSORS_ONLN);
}

/* --- Standard streams and messages --- */

void system_fill_standard_streams(void)
{
    int descriptor;
    do descriptor = open("/dev/null", O_RDWR);
    while (descriptor >= 0 && descriptor <= STDERR_FILENO);
    if (descriptor > STDERR_FILENO) close(descriptor);
}

bool system_talks_to_terminal(void) { return isatty(STDERR_FILENO) == 1; }

/* Writes a whole text to standard output, even if standard output is a pipe that accepts only part of the bytes in each
   call. If a pipe repeatedly reports that it is ready but accepts no data, the rest of the text is discarded without an
   error. */
int system_print(const char *bytes)
{
    size_t count = strlen(bytes);
    for (int refusals = 0; count > 0 && refusals < 1000;) {
        const ssize_t written = write(STDOUT_FILENO, bytes, count);
        if (written >= 0) {
            bytes += written;
            count -= (size_t)written;
            refusals = 0;
        } else if (errno == EAGAIN || errno == EINTR) {
            struct pollfd output = {.fd = STDOUT_FILENO, .events = POLLOUT};
            poll(&output, 1, -1);
            refusals++;
        } else {
            return -1;
        }
    }
    return 0;
}

/* Resource limit of the process, as displayed by `ulimit`; INT64_MAX for an unlimited resource. */
static int64_t limit_of(int resource)
{
    struct rlimit limit;
    if (getrlimit(resource, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return INT64_MAX;
    return (int64_t)limit.rlim_cur;
}

int64_t system_largest_file(void) { return limit_of(RLIMIT_FSIZE); }

/* Reason for the last failure of a system call. If too many files are open, the text also states the limit and the
   option of `ulimit` that raises it. */
void system_describe_problem(char *text, size_t size)
{
    const int problem = errno;
    strncpy(text, strerror(problem), size - 1);
    text[size - 1] = '\0';
    if (problem == EMFILE)
        snprintf(text, size, "%s: the limit is %lld (ulimit -n)", strerror(problem), (long long)limit_of(RLIMIT_NOFILE));
}

void system_name_host(char *text, size_t size)
{
    if (gethostname(text, size) != 0) strncpy(text, "unknown", size);
    text[size - 1] = '\0';
}

/* --- Files --- */

/* Opens a file whose name was chosen by the user. All other functions of this file open such files by calling this
   one. It does not wait if the file is a named pipe (O_NONBLOCK). */
static int open_file(const char *path, int flags)
{
    return open(path, flags | O_CLOEXEC | O_NONBLOCK | O_NOCTTY, 0644);
}

/* Closes a file without changing errno. The given status is returned, so that the caller can return the result
   directly. */
static int closed(int descriptor, int status)
{
    const int kept = errno;
    close(descriptor);
    errno = kept;
    return status;
}

/* Opens an existing regular file. A file with several names (symbolic or hard links) is not opened for writing, because
   writing could change a file that does not belong to the run. If the file cannot be opened, the result is -1 and
   `problem` contains the reason. */
static int open_regular(const char *path, int flags, const char **problem)
{
    struct stat file;
    const bool writing = flags != O_RDONLY;
    const int descriptor = open_file(path, writing ? flags | O_NOFOLLOW : flags);
    *problem = NULL;
    if (descriptor < 0 || fstat(descriptor, &file) != 0)
        *problem = writing && errno == ELOOP ? "it is a symbolic link" : strerror(errno);
    else if (S_ISDIR(file.st_mode))
        *problem = strerror(EISDIR);
    else if (!S_ISREG(file.st_mode))
        *problem = "it is a pipe or a device, not a file";
    else if (writing && file.st_nlink > 1)
        *problem = "it has a second name, by a hard link";
    if (descriptor < 0 || !*problem) return descriptor;
    close(descriptor);
    errno = EINVAL;
    return -1;
}

/* Names of the files of a folder that have the given ending, without it, in alphabetical order. Each name is padded with
   blanks to `width`; longer names are left out. Returns the number of names, at most `most`; 0 if there is no folder. */
int system_list_names(const char *folder, const char *ending, char *names, int width, int most)
{
    struct dirent **entry;
    const int entries = scandir(folder, &entry, NULL, alphasort);
    int count = 0;
    memset(names, ' ', (size_t)width*(size_t)most);
    for (int k = 0; k < entries; k++) {
        const char *name = entry[k]->d_name;
        const size_t length = strlen(name), stem = length - strlen(ending);
        if (length > strlen(ending) && strcmp(name + stem, ending) == 0 && stem <= (size_t)width && count < most)
            memcpy(names + (size_t)width*(size_t)count++, name, stem);
        free(entry[k]);
    }
    if (entries >= 0) free(entry);
    return count;
}

/* Reason why a file cannot be opened for reading or, with `writable`, for writing; empty if it can. */
void system_opening_problem(const char *path, bool writable, char *text, size_t size)
{
    const char *problem;
    const int descriptor = open_regular(path, writable ? O_RDWR : O_RDONLY, &problem);
    if (descriptor >= 0) close(descriptor);
    strncpy(text, problem ? problem : "", size - 1);
    text[size - 1] = '\0';
}

/* Reads the first `count` bytes of a file. Returns the number of bytes read, which is less than `count` for a shorter
   file, or -1 after a failure. */
int64_t system_read_bytes(const char *path, char *bytes, int64_t count)
{
    const char *problem;
    const int descriptor = open_regular(path, O_RDONLY, &problem);
    int64_t total = 0, more = 1;
    if (descriptor < 0) return -1;
    while (more > 0 && total < count) {
        do more = pread(descriptor, bytes + total, (size_t)(count - total), (off_t)total);
        while (more < 0 && errno == EINTR);
        total += more;
    }
    return closed(descriptor, 0) + (more < 0 ? -1 : total);
}

/* Overwrites eight bytes of a file with a 64-bit integer in little-endian order. */
int system_write_word(const char *path, int64_t position, int64_t word)
{
    const char *problem;
    unsigned char bytes[8];
    const int descriptor = open_regular(path, O_WRONLY, &problem);
    if (descriptor < 0) return -1;
    for (int k = 0; k < 8; k++) bytes[k] = (unsigned char)((uint64_t)word >> 8*k);
    return closed(descriptor, pwrite(descriptor, bytes, sizeof bytes, (off_t)position) == sizeof bytes ? 0 : -1);
}

int system_find_folder(const char *path)
{
    struct stat found;
    return stat(path, &found) == 0 && S_ISDIR(found.st_mode) ? 0 : -1;
}

/* Kind of the object at a path, as an index into `kinds_of_files` in system.f90. Symbolic links are not followed. The
   result is `nothing` only if the path certainly does not exist. */
int system_what_is(const char *path)
{
    enum { nothing = 1, file, folder, symbolic_link, pipe_or_device, hidden };
    struct stat found;
    if (lstat(path, &found) != 0)
        return errno == ENOENT || errno == ENOTDIR || errno == ENAMETOOLONG ? nothing : hidden;
    return S_ISREG(found.st_mode) ? file : S_ISDIR(found.st_mode) ? folder
         : S_ISLNK(found.st_mode) ? symbolic_link : pipe_or_device;
}

/* Inode, size and change time [ns] of a file. Symbolic links are not followed. */
void system_identify(const char *path, int64_t identity[3])
{
    struct stat found = {0};
    (void)!lstat(path, &found);
    identity[0] = (int64_t)found.st_ino;
    identity[1] = (int64_t)found.st_size;
    identity[2] = (int64_t)found.st_ctim.tv_sec*1000000000 + found.st_ctim.tv_nsec;
}

/* Size of a file in bytes; 0 for pipes and devices, -1 if the file does not exist. */
int64_t system_file_size(const char *path)
{
    struct stat found;
    return stat(path, &found) == 0 ? (int64_t)found.st_size : -1;
}

/* Waits until a file or folder is stored on disk. Two failures are not considered errors: some file systems cannot
   synchronise a folder (EINVAL), and a folder can be writable but not readable (EACCES). */
int system_synchronize(const char *path)
{
    const int descriptor = open_file(path, O_RDONLY);
    if (descriptor < 0) return errno == EACCES && system_find_folder(path) == 0 ? 0 : -1;
    return closed(descriptor, fsync(descriptor) == 0 || errno == EINVAL ? 0 : -1);
}

/* Creates a folder. It is no error if the folder exists, because another process may have just created it. */
int system_make_folder(const char *path)
{
    return mkdir(path, 0777) == 0 || errno == EEXIST ? 0 : -1;
}

int64_t system_free_bytes(const char *folder)
{
    struct statvfs disk;
    if (statvfs(folder, &disk) != 0 || disk.f_blocks == 0) return INT64_MAX;
    return (int64_t)disk.f_frsize*(int64_t)disk.f_bavail;
}

/* True if a path is the name of an open file. */
static bool is_name_of(const char *path, const struct stat *file)
{
    struct stat named;
    return lstat(path, &named) == 0 && named.st_dev == file->st_dev && named.st_ino == file->st_ino;
}

/* Acquires a lock file. Returns a file descriptor, or one of the negative numbers of the enumeration below, which are
   also defined in system.f90. The lock file of a run is an empty regular file with a single name; any other file is
   `foreign`. A lock file without write permission belongs to a run of another user and is `taken`. */
int system_lock(const char *path)
{
    enum { taken = -1, without_locks = -2, foreign = -3, failed = -4 };
    for (int trial = 0; trial < 100; trial++) {
        struct stat file = {0};
        const int descriptor = open_file(path, O_RDWR | O_CREAT | O_NOFOLLOW), reason = errno;
        const bool exists = (descriptor < 0 ? lstat(path, &file) : fstat(descriptor, &file)) == 0;
        if (exists && (!S_ISREG(file.st_mode) || file.st_nlink > 1 || file.st_size > 0))
            return descriptor < 0 ? foreign : closed(descriptor, foreign);
        errno = reason;
        if (descriptor < 0) return exists && errno == EACCES ? taken : failed;
        if (flock(descriptor, LOCK_EX | LOCK_NB) != 0)
            return closed(descriptor, errno == EWOULDBLOCK ? taken : without_locks);
        /* The previous holder of the lock may have deleted the file meanwhile. A lock on a deleted file would have no
           effect, because other runs would create a new file. */
        if (is_name_of(path, &file)) return descriptor;
        close(descriptor);
    }
    return taken;
}

/* Releases the lock and deletes the lock file, unless the path is now the name of a different file. */
void system_unlock(const char *path, int descriptor)
{
    struct stat file;
    if (fstat(descriptor, &file) == 0 && is_name_of(path, &file)) unlink(path);
    close(descriptor);
}
