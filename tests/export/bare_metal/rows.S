/* The readings of the replay, five numbers to a step. */
    .section .rodata
    .balign 8
    .global rows
rows:
    .incbin "rows.bin"
    .section .note.GNU-stack, "", %progbits
