/* Solves the QPs of a file, each cold and warm, and writes what comes out: driver PROBLEMS ANSWERS.
 *
 * Every solve is done twice, with all memory it may write to full of ones first and of zeros then: what is read before
 * it is written would show in the answer. Workspaces have the size that is asked for and not a byte more.
 * COUNT_ALLOCATIONS: link with -Wl,--wrap=malloc,--wrap=calloc,--wrap=realloc; an allocation within a solve is an error.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "kinqp_qp.h"

static int solving, allocations;

#ifdef COUNT_ALLOCATIONS
void *__real_malloc(size_t size);
void *__real_calloc(size_t count, size_t size);
void *__real_realloc(void *block, size_t size);
void *__wrap_malloc(size_t size);
void *__wrap_calloc(size_t count, size_t size);
void *__wrap_realloc(void *block, size_t size);
void *__wrap_malloc(size_t size) {
    allocations += solving;
    return __real_malloc(size);
}
void *__wrap_calloc(size_t count, size_t size) {
    allocations += solving;
    return __real_calloc(count, size);
}
void *__wrap_realloc(void *block, size_t size) {
    allocations += solving;
    return __real_realloc(block, size);
}
#endif

static void *need(size_t size) {
    void *block = malloc(size ? size : 1);
    if (!block) exit(3);
    return block;
}

static double *numbers(FILE *in, int count) {
    double *block = need((size_t)count * sizeof(double));
    if (fread(block, sizeof(double), (size_t)count, in) != (size_t)count) exit(4);
    return block;
}

/* One solve with all memory filled with `byte` before; out: x, y, z, z_box. */
static int solve(const kinqp_qp *qp, const kinqp_qp_options *options, int byte, double *out, int *active) {
    const size_t size = kinqp_qp_workspace_size(qp->n, qp->p, qp->m);
    void *memory = need(size);
    kinqp_qp_solution s;
    memset(memory, byte, size);
    memset(&s, byte, sizeof s);
    memset(out, byte, (size_t)(2 * qp->n + qp->p + qp->m) * sizeof(double));
    s.x = out;
    s.y = s.x + qp->n;
    s.z = s.y + qp->p;
    s.z_box = s.z + qp->m;
    s.active = active;
    solving = 1;
    const int status = (int)kinqp_qp_solve(qp, options, memory, &s);
    solving = 0;
    free(memory);
    return status * 100000 + s.iterations;
}

int main(int argc, char **argv) {
    FILE *in = argc == 3 ? fopen(argv[1], "rb") : NULL, *out = argc == 3 ? fopen(argv[2], "wb") : NULL;
    int sizes[3], differ = 0;
    if (!in || !out) return 2;
    while (fread(sizes, sizeof(int), 3, in) == 3) {
        const int n = sizes[0], p = sizes[1], m = sizes[2], count = 2 * n + p + m;
        double *data[9];
        const int lengths[9] = {n * n, n, p * n, p, m * n, m, m, n, n};
        for (int i = 0; i < 9; ++i) data[i] = numbers(in, lengths[i]);
        double *start = numbers(in, m + n);
        const kinqp_qp qp = {n, p, m, data[0], data[1], data[2], data[3], data[4], data[5], data[6], data[7], data[8]};
        kinqp_qp_options options = kinqp_qp_default_options(n, p, m);
        double *one = need((size_t)count * sizeof(double)), *two = need((size_t)count * sizeof(double));
        int *active = need((size_t)(m + n) * sizeof(int));
        for (options.warm = 0; options.warm < 2; ++options.warm) {
            for (int i = 0; i < m + n; ++i) active[i] = options.warm ? (int)start[i] : 0;
            const int first = solve(&qp, &options, 0xff, one, active);
            for (int i = 0; i < m + n; ++i) active[i] = options.warm ? (int)start[i] : 0;
            differ += solve(&qp, &options, 0, two, active) != first;
            differ += memcmp(one, two, (size_t)count * sizeof(double)) != 0;
            fwrite(&first, sizeof(int), 1, out);
            fwrite(one, sizeof(double), (size_t)count, out);
        }
        for (int i = 0; i < 9; ++i) free(data[i]);
        free(start);
        free(one);
        free(two);
        free(active);
    }
    fclose(in);
    if (fclose(out)) return 5;
    printf("differ %d, allocations %d\n", differ, allocations);
    return differ || allocations;
}
