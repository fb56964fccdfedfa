/* Functions of the machine for the replay. */
#include <stdint.h>

int replay(void);
void board_put(const char *text);
uint32_t board_ticks(void);
uint32_t board_stack(void);
