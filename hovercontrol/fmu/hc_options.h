/* What this runtime has. The exporter puts another file in place of this one where a model needs more. */
#ifndef HC_OPTIONS_H
#define HC_OPTIONS_H

#define HC_DELAYS 0 /* inputs that act late */

#endif
