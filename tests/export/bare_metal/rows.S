/* The readings of the replay, with five numbers per step. */
    .section .rodata
    .balign 8
    .global rows
rows:
    .incbin "rows.bin"
    .section .note.GNU-stack, "", %progbits
