/* A barrier that threads reach thousands of times per second, on cores that may be shared with other programs. A thread
   spins (waits in a loop) if its recent waits were short, and sleeps if they were long. On otherwise idle cores no time
   is lost; on busy cores no thread wastes its time slice waiting for a thread that is not running. OpenMP barriers, in
   contrast, spin either for milliseconds each time or never, depending on environment variables read at the start of
   the program. The Fortran interfaces of the barrier are in team.f90. */
#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <string.h>

double system_seconds(void);

struct barrier {
    atomic_int threads; /* number of registered threads */
    atomic_int arrived; /* number of threads that arrived in this round */
    atomic_int round;
    pthread_mutex_t lock;
    pthread_cond_t released;
};
_Static_assert(sizeof(struct barrier) <= 256, "barrier_t in team.f90 keeps 256 bytes for it");

static const double longest_spin = 100e-6; /* in seconds */

static _Thread_local double usual_wait; /* running average of the waiting times of this thread [s] */

void barrier_open(struct barrier *self)
{
    memset(self, 0, sizeof *self);
    pthread_mutex_init(&self->lock, NULL);
    pthread_cond_init(&self->released, NULL);
}

void barrier_close(struct barrier *self)
{
    pthread_cond_destroy(&self->released);
    pthread_mutex_destroy(&self->lock);
}

void barrier_join(struct barrier *self) { self->threads++; }

static inline void relax(void)
{
#if defined __x86_64__ || defined __i386__
    __builtin_ia32_pause();
#elif defined __aarch64__
    __asm__ volatile("yield");
#endif
}

static void wait_for_release(struct barrier *self, int round)
{
    const double began = system_seconds();
    double waited = 0;
    for (int k = 0; usual_wait < longest_spin && waited < longest_spin && self->round == round; k++) {
        relax();
        if (k%32 == 31) waited = system_seconds() - began;
    }
    pthread_mutex_lock(&self->lock);
    while (self->round == round) pthread_cond_wait(&self->released, &self->lock);
    pthread_mutex_unlock(&self->lock);
    waited = system_seconds() - began;
    usual_wait += ((waited < 2*longest_spin ? waited : 2*longest_spin) - usual_wait)/8;
}

/* Returns true, without waiting, to the last thread that arrives. All other threads wait until the last one has called
   barrier_release; the function then returns false. */
bool barrier_arrive(struct barrier *self)
{
    const int round = self->round;
    if (++self->arrived == self->threads) return true;
    wait_for_release(self, round);
    return false;
}

void barrier_release(struct barrier *self)
{
    self->arrived = 0;
    pthread_mutex_lock(&self->lock);
    self->round++;
    pthread_mutex_unlock(&self->lock);
    /* broadcast after unlocking, so that a thread waking up need not wait for the lock */
    pthread_cond_broadcast(&self->released);
}
