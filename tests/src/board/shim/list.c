/* Arrays that grow. */
#include "board.h"
#include <stdlib.h>

void list_grow(void **items, size_t *capacity, size_t count, size_t size) {
    *capacity = count < 64 ? 64 : 2 * count;
    *items = realloc(*items, *capacity * size);
    if (!*items)
        abort();
}
