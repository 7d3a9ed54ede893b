/* Messages to the importer's logger, and checks of each call. */
#include "hc_instance_internal.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

static const char *const category_names[] = {"logEvents", "logStatusWarning", "logStatusDiscard", "logStatusError"};
#define N_CATEGORIES 4
#define ALL_CATEGORIES 15u

static void log_text(const hc_log_type *log, int status, const char *function, const char *format, va_list values)
{
    char text[600];
    int n = 0;
    if (!log->callback || !(log->categories >> status & 1u))
        return;
    if (function)
        n = snprintf(text, sizeof text, "%s: ", function);
    if (n >= 0 && (size_t)n < sizeof text)
        vsnprintf(text + n, sizeof text - (size_t)n, format, values);
    log->emit(log, status, category_names[status], text);
}

void hc_log_message(const hc_log_type *log, int status, const char *function, const char *format, ...)
{
    va_list values;
    va_start(values, format);
    log_text(log, status, function, format, values);
    va_end(values);
}

int hc_fail(hc_instance *c, const char *format, ...)
{
    va_list values;
    va_start(values, format);
    log_text(&c->log, HC_ERROR, c->function, format, values);
    va_end(values);
    c->state = HC_FAILED;
    return HC_ERROR;
}

int hc_discard(hc_instance *c, const char *format, ...)
{
    va_list values;
    va_start(values, format);
    log_text(&c->log, HC_DISCARD, c->function, format, values);
    va_end(values);
    return HC_DISCARD;
}

int hc_not_supported(hc_instance *c, const char *what)
{
    return hc_fail(c, "not supported: %s", what);
}

int hc_no_null(hc_instance *c, const void *pointer, const char *name, size_t n)
{
    if (n == 0 || pointer)
        return HC_DONE;
    return hc_fail(c, "%s is NULL where a pointer is needed", name);
}

void hc_name_states(const hc_instance *c, unsigned states, char *text, size_t size)
{
    static const char *const names[] = {"Instantiated", "Initialization Mode", "Event Mode", "Continuous-Time Mode",
                                        NULL,           "Terminated",          "Error",      "Intermediate Update Mode"};
    size_t n = 0;
    text[0] = '\0';
    for (int i = 0; i < 8; i++)
        if (states >> i & 1u && n < size) {
            const char *name = names[i] ? names[i] : c->log.version == 2 ? "Step Complete" : "Step Mode";
            const int more = snprintf(text + n, size - n, "%s%s", n > 0 ? ", " : "", name);
            n += more > 0 ? (size_t)more : 0;
        }
}

int hc_refuse_state(hc_instance *c, unsigned allowed)
{
    char now[40], where[160];
    hc_name_states(c, c->state, now, sizeof now);
    hc_name_states(c, allowed & ~(unsigned)HC_FAILED, where, sizeof where);
    if (c->state == HC_FAILED)
        hc_fail(c, "not allowed after an error: reset the instance, restore a state of it, or free it");
    else
        hc_fail(c, "not allowed in the state %s; allowed in: %s", now, where[0] ? where : "none");
    return 0;
}

int hc_refuse_kind(hc_instance *c, int kind)
{
    hc_fail(c, "only for %s; this instance is of the other kind",
            kind == HC_MODEL_EXCHANGE ? "Model Exchange" : "Co-Simulation");
    return 0;
}

int hc_set_logging(hc_instance *c, int on, size_t n, const char *const categories[])
{
    unsigned chosen = n == 0 ? ALL_CATEGORIES : 0;
    if (hc_no_null(c, categories, "categories", n))
        return HC_ERROR;
    for (size_t i = 0; i < n; i++) {
        unsigned found = 0;
        for (int k = 0; k < N_CATEGORIES && categories[i]; k++)
            if (strcmp(categories[i], category_names[k]) == 0)
                found = 1u << k;
        if (categories[i] && strcmp(categories[i], "logAll") == 0)
            found = ALL_CATEGORIES;
        if (!found)
            return hc_fail(c,
                           "unknown log category \"%.60s\"; known: logEvents, logStatusWarning, logStatusDiscard, "
                           "logStatusError, logAll",
                           categories[i] ? categories[i] : "NULL");
        chosen |= found;
    }
    c->log.categories = on ? chosen | (c->log.version == 2 ? 0 : c->log.categories) : c->log.categories & ~chosen;
    return HC_DONE;
}
