(** The definitions in the statements of the theorems. Besides the statements in Theorems.v,
    this file is all that has to be read to know what is proved. *)
From Coq Require Import Reals List.
Open Scope R_scope.

(** The sum of f over a list. [sum (seq 0 n) f] is f 0 + ... + f (n-1). *)
Definition sum {A} (l : list A) (f : A -> R) : R := fold_right (fun a s => f a + s) 0 l.

Definition delta (i j : nat) : R := if Nat.eqb i j then 1 else 0.

(** J a i is the entry in row a < 6 and column i < n of a Jacobian with n joints. Rows 0 to 2
    of column i are the linear velocity v_i, rows 3 to 5 the angular velocity omega_i. Indices
    outside of these ranges are never used. *)
Definition matrix := nat -> nat -> R.

(** The scalar product of vectors with n components *)
Definition dot n (x y : nat -> R) := sum (seq 0 n) (fun i => x i * y i).
Definition column (J : matrix) (i : nat) : nat -> R := fun a => J a i.

(** All n joints are revolute: |omega_i| = 1 and v_i . omega_i = 0. *)
Record revolute (n : nat) (J : matrix) : Prop := {
  unit_axes : forall i, (i < n)%nat ->
    sum (seq 0 3) (fun k => J (3 + k)%nat i * J (3 + k)%nat i) = 1;
  orthogonal : forall i, (i < n)%nat ->
    sum (seq 0 3) (fun k => J k i * J (3 + k)%nat i) = 0
}.

(** J J^T = s I, and all columns have the same norm. *)
Record optimally_failure_tolerant (n : nat) (J : matrix) (s : R) : Prop := {
  isotropic : forall a b, (a < 6)%nat -> (b < 6)%nat ->
    sum (seq 0 n) (fun i => J a i * J b i) = s * delta a b;
  equal_norms : forall i j, (i < n)%nat -> (j < n)%nat ->
    dot 6 (column J i) (column J i) = dot 6 (column J j) (column J j)
}.

Definition exists_optimal (n : nat) :=
  exists J s, revolute n J /\ optimally_failure_tolerant n J s.

(** Whichever joint f is locked, sigma_6^2 >= t remains. Here sigma_6^2 is the smallest squared
    singular value of the 6 x (n-1) matrix J_f that is J without column f, and so the minimum of
    |J_f^T x|^2 over the vectors x of norm 1. *)
Definition worst_case_at_least (n : nat) (J : matrix) (t : R) := forall f x, (f < n)%nat ->
  t * dot 6 x x
  <= sum (seq 0 n) (fun i =>
       if Nat.eqb i f then 0 else dot 6 (column J i) x * dot 6 (column J i) x).

(** The squared Frobenius norm of J, which is 6 sigma^2 in the notation of eq. (6) of the paper *)
Definition squared_norm (n : nat) (J : matrix) :=
  sum (seq 0 n) (fun i => dot 6 (column J i) (column J i)).

(** Eq. (6), squared: the worst case is at most sigma^2 (n-6)/n. *)
Definition bound (n : nat) (J : matrix) := squared_norm n J * (INR n - 6) / (6 * INR n).
