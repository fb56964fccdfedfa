/* Functions that the replay requires of a machine. */
#include <stdint.h>

int replay(void);
void board_put(const char *text);
uint32_t board_ticks(void);
uint32_t board_stack(void);
