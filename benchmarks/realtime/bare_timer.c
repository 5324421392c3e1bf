/* A timer and nothing else, without Python: what the machine can give. Prints how late the ticks of an absolute grid came.

       cc -O2 -o bare_timer bare_timer.c && ./bare_timer SECONDS [PRIORITY]

   One line: ticks, missed periods, then p50, p99, p99.9 and the longest lateness [us]. With a priority: SCHED_FIFO and
   locked memory. The period is 1 ms. */

#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <time.h>

#define PERIOD 1000000LL

static long long now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * 1000000000LL + t.tv_nsec;
}

static int ascending(const void *a, const void *b)
{
    long long x = *(const long long *)a, y = *(const long long *)b;
    return (x > y) - (x < y);
}

int main(int count, char **arguments)
{
    long ticks = count > 1 ? (long)(1000 * atof(arguments[1])) : 5000, made = 0, missed = 0;
    int priority = count > 2 ? atoi(arguments[2]) : 0;
    long long *late = calloc(ticks, sizeof *late);
    prctl(PR_SET_TIMERSLACK, 1, 0, 0, 0);
    if (priority) {
        struct sched_param wanted = {.sched_priority = priority};
        if (sched_setscheduler(0, SCHED_FIFO, &wanted) || mlockall(MCL_CURRENT | MCL_FUTURE))
            perror("bare_timer: without priority or locked memory");
    }
    for (long long first = now() + PERIOD, tick = 0; tick < ticks; tick++) {
        long long deadline = first + tick * PERIOD;
        struct timespec until = {deadline / 1000000000LL, deadline % 1000000000LL};
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL);
        long long behind = now() - deadline;
        late[made++] = behind;
        missed += behind / PERIOD;
        tick += behind / PERIOD;
    }
    qsort(late, made, sizeof *late, ascending);
    printf("%ld %ld %.1f %.1f %.1f %.1f\n", made, missed, late[made / 2] / 1e3, late[(long)(0.99 * (made - 1))] / 1e3,
           late[(long)(0.999 * (made - 1))] / 1e3, late[made - 1] / 1e3);
    return 0;
}
