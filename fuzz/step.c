/* libFuzzer on an exported step, or on the guiding controller around it: any bits in every parameter and input.
 *
 * PREFIX and HEADER name the export; GUIDING is 1 for <prefix>_guiding.h. The bytes are a program: the first is the
 * number of ticks, then come changes of one value each in the parameters or the input, and ticks. Whatever is sent:
 * nothing may crash or hang, and a tick that says SOLVED must have a finite command.
 */
#include HEADER

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define JOIN(a, b) a##b
#define JOINED(a, b) JOIN(a, b)
#define P(name) JOINED(PREFIX, name)

#if GUIDING
typedef P(_guiding_parameters) parameters_type;
typedef P(_guiding_state) state_type;
typedef P(_guiding_input) input_type;
typedef P(_guiding_output) output_type;
#else
typedef P(_parameters) parameters_type;
typedef P(_input) input_type;
typedef P(_output) output_type;
#endif

/* What random bits seldom are. */
static const double SPECIAL[] = {0.0,    -0.0,   1.0,     -1.0,   1e-3,    0.5,     -2.0,   1e-5,   1e-9,    -1e-17,
                                 1e-300, 5e-324, 1e16,    -1e21,  1e150,   1e300,   -1e308, 3.14,   1.5708,  -1.5708,
                                 2.9,    0.01,   __builtin_inf(), -__builtin_inf(), __builtin_nan(""), 1e6, 100.0, 10.0};
enum { SPECIALS = sizeof SPECIAL / sizeof *SPECIAL };

typedef struct {
    const uint8_t *at;
    size_t left;
} reader;

static unsigned byte(reader *from) {
    if (!from->left) return 0;
    --from->left;
    return *from->at++;
}

/* Changes one value: a double that is usual in such places, any eight bytes, or an int of any bits. */
static void change(reader *from, unsigned char *structure, size_t size) {
    const size_t place = (byte(from) | byte(from) << 8) % (size / 8) * 8;
    const unsigned kind = byte(from);
    unsigned char value[8];
    if (kind < 4 * SPECIALS) {
        memcpy(value, &SPECIAL[kind % SPECIALS], 8);
    } else if (kind < 250) {
        for (int i = 0; i < 8; ++i) value[i] = (unsigned char)byte(from);
    } else {
        const int32_t small[2] = {(int8_t)byte(from), (int8_t)byte(from)};
        memcpy(value, small, 8);
    }
    memcpy(structure + place, value, 8);
}

static int finite(const double *values, size_t count) {
    for (size_t i = 0; i < count; ++i) {
        uint64_t bits;
        memcpy(&bits, values + i, 8);
        if ((bits >> 52 & 0x7ff) == 0x7ff) return 0;
    }
    return 1;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    reader from = {data, size};
    /* Blocks of exactly their size on the heap: AddressSanitizer sees a step beyond any of them. */
    parameters_type *parameters = malloc(sizeof *parameters);
    input_type *input = calloc(1, sizeof *input);
    output_type *output = malloc(sizeof *output);
    if (!parameters || !input || !output) abort();
#if GUIDING
    state_type *state = malloc(sizeof *state);
    if (!state) abort();
    P(_default_guiding)(parameters);
    P(_start_guiding)(parameters, state);
#else
    P(_default_parameters)(parameters);
#endif
    for (unsigned tick = byte(&from) % 16 + 1; tick; --tick) {
        for (unsigned changes = byte(&from) % 8; changes; --changes) change(&from, (unsigned char *)parameters, sizeof *parameters);
        for (unsigned changes = byte(&from) % 16; changes; --changes) change(&from, (unsigned char *)input, sizeof *input);
        memset(output, 0xff, sizeof *output);
#if GUIDING
        const kinqp_status status = P(_guiding_tick)(parameters, state, input, output);
#else
        const kinqp_status status = P(_step)(parameters, input, output);
#endif
        if (status != output->status) {
            fprintf(stderr, "returned status %d, wrote %d\n", (int)status, (int)output->status);
            abort();
        }
        if (status == KINQP_SOLVED && !finite(output->qd, sizeof output->qd / sizeof *output->qd)) {
            fprintf(stderr, "SOLVED with a command that is not finite\n");
            abort();
        }
    }
#if GUIDING
    free(state);
#endif
    free(parameters);
    free(input);
    free(output);
    return 0;
}
