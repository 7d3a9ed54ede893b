/* How a corrected FMU passes on what FMI 2.0 and 3.0 define alike. hc_around_fmi2.c and hc_around_fmi3.c each include
 * this file once, and the functions of the table.
 */
#include "hc_around.h"

#include "hc_table.h"

#include <stdlib.h>

static void release(hc_around *c)
{
    if (!c)
        return;
    if (c->inner && c->inner->component)
        c->inner->FreeInstance(c->inner->component);
    if (c->inner && c->inner->library)
        hc_library_close(c->inner->library);
    free(c->inner);
    hc_around_free(c);
}

static int hc_around_set_logging(hc_around *c, hc_boolean on, size_t n, const char *const categories[])
{
    return (int)PASS(SetDebugLogging, on, n, categories);
}

static int hc_around_exit_initialization(hc_around *c)
{
    int status;
    if (hc_around_before_exit(c) >= HC_DISCARD)
        return HC_ERROR;
    status = (int)PASS_PLAIN(ExitInitializationMode);
    return status < HC_DISCARD ? hc_around_after_exit(c) : status;
}

static int hc_around_terminate(hc_around *c)
{
    c->state = HC_TERMINATED;
    return (int)PASS_PLAIN(Terminate);
}

static int hc_around_reset(hc_around *c)
{
    const int status = (int)PASS_PLAIN(Reset);
    return status < HC_DISCARD ? hc_around_start(c) : status;
}

HC_TABLE(HC_FUNCTION)

void FMI(FreeInstance)(HC_ARGUMENTS)
{
    release(instance);
}
