!> CRC-32 (ISO-HDLC: that of zlib, gzip and PNG) of numbers, over the bytes that they have in a file, lowest byte first.
!>
!> Eight or sixteen bytes at a time: `zeros_k(b)` is what byte b has become k bytes later, and the remainder is linear.
module spurflex_base_checksum
   use spurflex_base_kinds, only: i4, i8, wp
   implicit none
   private

   public :: extended, extended_over, checksum_name

   !> Name of the checksum.
   character(len=*), parameter :: checksum_name = 'CRC-32'

   !> The polynomial 0xEDB88320, lowest power first.
   integer(i4), parameter :: polynomial = not(int(z'12477CDF', i4))
   integer(i4), parameter :: byte = 255_i4
   integer :: i

   ! The table of one byte, bit by bit.
   integer(i4), parameter :: bits_0(0:255) = [(int(i, i4), i=0, 255)]
   integer(i4), parameter :: bits_1(0:255) = ieor(shiftr(bits_0, 1), iand(polynomial, -iand(bits_0, 1_i4)))
   integer(i4), parameter :: bits_2(0:255) = ieor(shiftr(bits_1, 1), iand(polynomial, -iand(bits_1, 1_i4)))
   integer(i4), parameter :: bits_3(0:255) = ieor(shiftr(bits_2, 1), iand(polynomial, -iand(bits_2, 1_i4)))
   integer(i4), parameter :: bits_4(0:255) = ieor(shiftr(bits_3, 1), iand(polynomial, -iand(bits_3, 1_i4)))
   integer(i4), parameter :: bits_5(0:255) = ieor(shiftr(bits_4, 1), iand(polynomial, -iand(bits_4, 1_i4)))
   integer(i4), parameter :: bits_6(0:255) = ieor(shiftr(bits_5, 1), iand(polynomial, -iand(bits_5, 1_i4)))
   integer(i4), parameter :: bits_7(0:255) = ieor(shiftr(bits_6, 1), iand(polynomial, -iand(bits_6, 1_i4)))
   integer(i4), parameter :: zeros_0(0:255) = ieor(shiftr(bits_7, 1), iand(polynomial, -iand(bits_7, 1_i4)))
   integer(i4), parameter :: zeros_1(0:255) = [(ieor(shiftr(zeros_0(i), 8), zeros_0(iand(zeros_0(i), byte))), i=0, 255)]
   integer(i4), parameter :: zeros_2(0:255) = [(ieor(shiftr(zeros_1(i), 8), zeros_0(iand(zeros_1(i), byte))), i=0, 255)]
   integer(i4), parameter :: zeros_3(0:255) = [(ieor(shiftr(zeros_2(i), 8), zeros_0(iand(zeros_2(i), byte))), i=0, 255)]
   integer(i4), parameter :: zeros_4(0:255) = [(ieor(shiftr(zeros_3(i), 8), zeros_0(iand(zeros_3(i), byte))), i=0, 255)]
   integer(i4), parameter :: zeros_5(0:255) = [(ieor(shiftr(zeros_4(i), 8), zeros_0(iand(zeros_4(i), byte))), i=0, 255)]
   integer(i4), parameter :: zeros_6(0:255) = [(ieor(shiftr(zeros_5(i), 8), zeros_0(iand(zeros_5(i), byte))), i=0, 255)]
   integer(i4), parameter :: zeros_7(0:255) = [(ieor(shiftr(zeros_6(i), 8), zeros_0(iand(zeros_6(i), byte))), i=0, 255)]
   integer(i4), parameter :: zeros_8(0:255) = [(ieor(shiftr(zeros_7(i), 8), zeros_0(iand(zeros_7(i), byte))), i=0, 255)]
   integer(i4), parameter :: zeros_9(0:255) = [(ieor(shiftr(zeros_8(i), 8), zeros_0(iand(zeros_8(i), byte))), i=0, 255)]
   integer(i4), parameter :: zeros_10(0:255) = [(ieor(shiftr(zeros_9(i), 8), zeros_0(iand(zeros_9(i), byte))), i=0, 255)]
   integer(i4), parameter :: zeros_11(0:255) = [(ieor(shiftr(zeros_10(i), 8), zeros_0(iand(zeros_10(i), byte))), i=0, 255)]
   integer(i4), parameter :: zeros_12(0:255) = [(ieor(shiftr(zeros_11(i), 8), zeros_0(iand(zeros_11(i), byte))), i=0, 255)]
   integer(i4), parameter :: zeros_13(0:255) = [(ieor(shiftr(zeros_12(i), 8), zeros_0(iand(zeros_12(i), byte))), i=0, 255)]
   integer(i4), parameter :: zeros_14(0:255) = [(ieor(shiftr(zeros_13(i), 8), zeros_0(iand(zeros_13(i), byte))), i=0, 255)]
   integer(i4), parameter :: zeros_15(0:255) = [(ieor(shiftr(zeros_14(i), 8), zeros_0(iand(zeros_14(i), byte))), i=0, 255)]

   !> The checksum of what came before and of one number more; 0 if nothing came before.
   interface extended
      module procedure :: extended_by_real
      module procedure :: extended_by_integer
   end interface extended

contains

   !> The checksum of what came before and of a real more.
   elemental function extended_by_real(checksum, number) result(longer)
      !> Checksum of what came before.
      integer(i4), intent(in) :: checksum
      !> The number, to the bit: NaN is one too.
      real(wp), intent(in) :: number
      !> Checksum of both.
      integer(i4) :: longer

      integer(i8) :: bits
      integer(i4) :: low, high

      bits = transfer(number, bits)
      low = ieor(not(checksum), int(ibits(bits, 0, 16), i4))
      low = ieor(low, shiftl(int(ibits(bits, 16, 16), i4), 16))
      high = ior(int(ibits(bits, 32, 16), i4), shiftl(int(ibits(bits, 48, 16), i4), 16))
      longer = not(ieor(ieor(ieor(zeros_7(iand(low, byte)), zeros_6(iand(shiftr(low, 8), byte))), &
                             ieor(zeros_5(iand(shiftr(low, 16), byte)), zeros_4(shiftr(low, 24)))), &
                        ieor(ieor(zeros_3(iand(high, byte)), zeros_2(iand(shiftr(high, 8), byte))), &
                             ieor(zeros_1(iand(shiftr(high, 16), byte)), zeros_0(shiftr(high, 24))))))
   end function extended_by_real

   !> The checksum of what came before and of an integer more.
   elemental function extended_by_integer(checksum, number) result(longer)
      !> Checksum of what came before.
      integer(i4), intent(in) :: checksum
      !> The number.
      integer(i4), intent(in) :: number
      !> Checksum of both.
      integer(i4) :: longer

      integer(i4) :: mixed

      mixed = ieor(not(checksum), number)
      longer = not(ieor(ieor(zeros_3(iand(mixed, byte)), zeros_2(iand(shiftr(mixed, 8), byte))), &
                        ieor(zeros_1(iand(shiftr(mixed, 16), byte)), zeros_0(shiftr(mixed, 24)))))
   end function extended_by_integer

   !> The checksum of what came before and of some reals more, one after the other.
   pure function extended_over(checksum, numbers) result(longer)
      !> Checksum of what came before; 0 if nothing did.
      integer(i4), intent(in) :: checksum
      !> The numbers, to the bit.
      real(wp), intent(in), contiguous :: numbers(:)
      !> Checksum of all.
      integer(i4) :: longer

      integer(i8), parameter :: one_byte = 255_i8
      integer(i8) :: first, second
      integer :: k

      longer = checksum
      do k = 1, size(numbers) - 1, 2
         ! The remainder so far meets the first four bytes.
         first = ieor(transfer(numbers(k), first), ibits(int(not(longer), i8), 0, 32))
         second = transfer(numbers(k + 1), second)
         longer = not(ieor(ieor(ieor(ieor(zeros_15(iand(first, one_byte)), zeros_14(ibits(first, 8, 8))), &
                                     ieor(zeros_13(ibits(first, 16, 8)), zeros_12(ibits(first, 24, 8)))), &
                                ieor(ieor(zeros_11(ibits(first, 32, 8)), zeros_10(ibits(first, 40, 8))), &
                                     ieor(zeros_9(ibits(first, 48, 8)), zeros_8(ibits(first, 56, 8))))), &
                           ieor(ieor(ieor(zeros_7(iand(second, one_byte)), zeros_6(ibits(second, 8, 8))), &
                                     ieor(zeros_5(ibits(second, 16, 8)), zeros_4(ibits(second, 24, 8)))), &
                                ieor(ieor(zeros_3(ibits(second, 32, 8)), zeros_2(ibits(second, 40, 8))), &
                                     ieor(zeros_1(ibits(second, 48, 8)), zeros_0(ibits(second, 56, 8)))))))
      end do
      if (mod(size(numbers), 2) == 1) longer = extended_by_real(longer, numbers(size(numbers)))
   end function extended_over

end module spurflex_base_checksum
