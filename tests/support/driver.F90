!> Runs all test suites in the generated list. pFUnit has its own driver, which reads the same list.
program unit_tests
  use funit, only: pf_begin, pf_finish
  implicit none
#define ADD_TEST_SUITE(suite) call suite()
  call pf_begin()
#include "tests.inc"
  call pf_finish()
end program unit_tests
