(** Eq. (6) of the paper, for n > 6 joints of any kind. The squared worst case is at most [bound],
    and it attains [bound] exactly if J is optimally failure-tolerant. Eigenvalues are not
    needed: the inverse of M - tI is built by induction with Schur complements, and a trace
    inequality does the rest. *)
From Coq Require Import Reals List Lia Lra Ring Arith.
From Lockedjoint Require Import Definitions Sums.
Import ListNotations.
Open Scope R_scope.

(** A symmetric positive definite matrix has a symmetric inverse. *)

(** Row i of the product of a matrix and a vector *)
Definition mv n (C : nat -> nat -> R) (x : nat -> R) i := sum (seq 0 n) (fun j => C i j * x j).

Definition positive n (C : nat -> nat -> R) :=
  forall x, (exists i, (i < n)%nat /\ x i <> 0) -> 0 < dot n x (mv n C x).

Lemma positive_inverse n : forall C, (forall i j, C i j = C j i) -> positive n C ->
  exists B, (forall i j, B i j = B j i) /\
    forall i j, (i < n)%nat -> (j < n)%nat -> sum (seq 0 n) (fun k => C i k * B k j) = delta i j.
Proof.
  induction n as [|n IH]; intros C Sy P.
  { exists (fun _ _ => 0). split; [easy|lia]. }
  destruct (IH C Sy) as [E [ES EI]].
  { intros x [i [I X]]. pose (y := fun k => if Nat.ltb k n then x k else 0).
    assert (forall k, (k < n)%nat -> y k = x k) as Y.
    { intros k K. unfold y. apply Nat.ltb_lt in K. rewrite K. reflexivity. }
    assert (y n = 0) as Yn by (unfold y; rewrite Nat.ltb_irrefl; reflexivity).
    assert (0 < dot (S n) y (mv (S n) C y)) as G.
    { apply P. exists i. split; [lia|]. rewrite Y; assumption. }
    unfold dot, mv in *. rewrite sum_S, Yn in G.
    rewrite (seq_ext n _ (fun i => x i * sum (seq 0 n) (fun j => C i j * x j))) in G; [lra|].
    intros k K. rewrite Y, sum_S, Yn by assumption.
    rewrite (seq_ext n _ (fun j => C k j * x j)); [ring|]. intros; rewrite Y by assumption; ring. }
  pose (u := fun i => sum (seq 0 n) (fun k => E i k * C k n)).
  assert (forall i, (i < n)%nat -> sum (seq 0 n) (fun k => C i k * u k) = C i n) as Du.
  { intros i I. unfold u.
    rewrite (seq_ext n _ (fun k => sum (seq 0 n) (fun l => C i k * E k l * C l n))).
    2:{ intros k _. rewrite <- sum_scale. apply sum_ext; intros; ring. }
    rewrite sum_swap.
    rewrite (seq_ext n _ (fun l => delta i l * C l n)).
    - apply (sum_delta n i (fun l => C l n)), I.
    - intros l Ll. rewrite <- (EI i l I Ll).
      rewrite (sum_ext _ _ (fun k => C l n * (C i k * E k l))) by (intros; ring). rewrite sum_scale. ring. }
  pose (q := sum (seq 0 n) (fun k => C k n * u k)).
  pose (s := C n n - q).
  assert (0 < s) as Spos.
  { pose (x := fun k => if Nat.ltb k n then u k else -1).
    assert (forall k, (k < n)%nat -> x k = u k) as X.
    { intros k K. unfold x. apply Nat.ltb_lt in K. rewrite K. reflexivity. }
    assert (x n = -1) as Xn by (unfold x; rewrite Nat.ltb_irrefl; reflexivity).
    assert (0 < dot (S n) x (mv (S n) C x)) as G.
    { apply P. exists n. split; [lia|]. rewrite Xn. lra. }
    unfold dot, mv in G. rewrite sum_S, Xn in G.
    rewrite (seq_ext n _ (fun _ => 0)) in G.
    2:{ intros i I. rewrite sum_S, Xn, (seq_ext n _ (fun j => C i j * u j)).
        - rewrite Du by assumption. ring.
        - intros; rewrite X by assumption; ring. }
    rewrite sum_const, sum_S, Xn, (seq_ext n _ (fun j => C j n * u j)) in G.
    2:{ intros k K. rewrite X by assumption. rewrite (Sy n k). ring. }
    fold q in G. unfold s. lra. }
  pose (e := fun k => if Nat.ltb k n then u k else -1).
  assert (forall k, (k < n)%nat -> e k = u k) as X.
  { intros k K. unfold e. apply Nat.ltb_lt in K. rewrite K. reflexivity. }
  assert (e n = -1) as Xn by (unfold e; rewrite Nat.ltb_irrefl; reflexivity).
  exists (fun i j => (if Nat.ltb i n then if Nat.ltb j n then E i j else 0 else 0) + e i * e j / s). split.
  { intros i j. rewrite (ES i j). destruct (Nat.ltb i n), (Nat.ltb j n); field; lra. }
  assert (forall i, (i <= n)%nat -> sum (seq 0 (S n)) (fun k => C i k * e k) = delta i n * - s) as Ce.
  { intros i I. rewrite sum_S, Xn, (seq_ext n _ (fun j => C i j * u j)) by (intros; rewrite X by assumption; ring).
    destruct (Nat.eq_dec i n) as [->|D].
    - rewrite delta_refl, (seq_ext n _ (fun k => C k n * u k)) by (intros k _; rewrite (Sy n k); ring).
      fold q. unfold s. ring.
    - rewrite Du by lia. unfold delta. destruct (Nat.eqb_spec i n); [lia|ring]. }
  intros i j I K.
  rewrite (sum_ext _ _ (fun k => C i k * (if Nat.ltb k n then if Nat.ltb j n then E k j else 0 else 0)
    + (e j / s) * (C i k * e k))) by (intros; field; lra).
  rewrite sum_add, sum_scale, Ce by lia. rewrite sum_S, Nat.ltb_irrefl.
  rewrite (seq_ext n _ (fun k => C i k * (if Nat.ltb j n then E k j else 0))).
  2:{ intros k L. apply Nat.ltb_lt in L. rewrite L. reflexivity. }
  destruct (Nat.eq_dec j n) as [->|Dj].
  - rewrite Nat.ltb_irrefl, Xn, (seq_ext n _ (fun _ => 0)), sum_const by (intros; ring). field. lra.
  - assert (j < n)%nat as Jn by lia. assert (Nat.ltb j n = true) as Jb by (apply Nat.ltb_lt; lia).
    rewrite Jb, (X j Jn). destruct (Nat.eq_dec i n) as [->|Di].
    + rewrite delta_refl. assert (sum (seq 0 n) (fun k => C n k * E k j) = u j) as ->.
      { unfold u. apply sum_ext; intros k _. rewrite (Sy n k), (ES k j). ring. }
      unfold delta. destruct (Nat.eqb_spec n j); [lia|]. field. lra.
    + rewrite EI by lia. unfold delta at 2. destruct (Nat.eqb_spec i n); [lia|]. field. lra.
Qed.

(** Whoever attains the bound is isotropic and has columns of equal norm. *)

Section Attained.
Variable n : nat.
Variable J : nat -> nat -> R.
Hypothesis redundant : (6 < n)%nat.
Hypothesis nonzero : 0 < squared_norm n J.
Hypothesis att : worst_case_at_least n J (bound n J).

Let t := bound n J.
Let p i x := dot 6 (column J i) x.
Let M a b := sum (seq 0 n) (fun i => J a i * J b i).
Let C a b := M a b - t * delta a b.
Let Qf x := dot 6 x (mv 6 C x).
Let N := INR n.
Let q := squared_norm n J / N.

Lemma N_large : 6 < N.
Proof. unfold N. replace 6 with (INR 6) by (simpl; ring). apply lt_INR, redundant. Qed.

Lemma t_of_q : 6 * t = q * (N - 6).
Proof. pose proof N_large. unfold t, q, bound. fold N. field. lra. Qed.

Lemma q_positive : 0 < q.
Proof. pose proof N_large. apply Rmult_lt_0_compat; [|apply Rinv_0_lt_compat]; lra. Qed.

Lemma t_positive : 0 < t.
Proof.
  pose proof N_large. pose proof t_of_q.
  assert (0 < q * (N - 6)) by (apply Rmult_lt_0_compat; [exact q_positive|lra]). lra.
Qed.

Lemma quadratic x : Qf x = sum (seq 0 n) (fun i => p i x * p i x) - t * dot 6 x x.
Proof.
  unfold Qf, p, column, dot, mv.
  rewrite (sum_mul_swap (seq 0 n) (seq 0 6) (seq 0 6) (fun a i => J a i * x a) (fun a i => J a i * x a)).
  transitivity (sum (seq 0 6) (fun a => sum (seq 0 6) (fun b => sum (seq 0 n) (fun k => J a k * x a * (J b k * x b)))
    + (- t) * (x a * x a))).
  2:{ rewrite sum_add, sum_scale. ring. }
  apply seq_ext; intros a A. unfold C, M.
  rewrite (sum_ext _ _ (fun b => sum (seq 0 n) (fun i => J a i * J b i) * x b + (- t) * (delta a b * x b)))
    by (intros; ring).
  rewrite sum_add, (sum_scale _ (- t)), (sum_delta 6 a x A), Rmult_plus_distr_l, <- sum_scale.
  f_equal; [|ring]. apply sum_ext; intros b _.
  transitivity ((x a * x b) * sum (seq 0 n) (fun i => J a i * J b i)); [ring|].
  rewrite <- sum_scale. apply sum_ext; intros; ring.
Qed.

Lemma leaves f x : (f < n)%nat -> p f x * p f x <= Qf x.
Proof.
  intros F. pose proof (att f x F) as A. fold t in A. rewrite quadratic.
  rewrite (sum_ext _ _ (fun i => p i x * p i x + (-1) * (delta f i * (p i x * p i x)))) in A.
  - rewrite sum_add, sum_scale, (sum_delta n f (fun i => p i x * p i x) F) in A. lra.
  - intros i _. unfold delta. rewrite Nat.eqb_sym. unfold p. destruct (Nat.eqb f i); ring.
Qed.

Lemma Qf_nonneg x : 0 <= Qf x.
Proof. assert (0 < n)%nat as O by lia. pose proof (leaves 0 x O). pose proof (Rle_0_sqr (p 0 x)). unfold Rsqr in *. lra. Qed.

Lemma Qf_zero x : Qf x = 0 -> forall i, (i < 6)%nat -> x i = 0.
Proof.
  intros E i I. assert (dot 6 x x = 0) as D.
  { pose proof t_positive. rewrite quadratic in E.
    rewrite (seq_ext n _ (fun _ => 0)), sum_const in E.
    - assert (t * dot 6 x x = 0) as F by lra. apply Rmult_integral in F. lra.
    - intros f F. pose proof (leaves f x F) as Lf. rewrite quadratic, E in Lf.
      pose proof (Rle_0_sqr (p f x)). unfold Rsqr in *. lra. }
  apply Rsqr_0_uniq. apply (sum_zero_each (seq 0 6) (fun i => x i * x i)); [intros; apply Rle_0_sqr|exact D|].
  apply in_seq. lia.
Qed.

Lemma C_positive : positive 6 C.
Proof.
  intros x [i [I X]]. destruct (Qf_nonneg x) as [G|E]; [exact G|].
  exfalso. apply X, Qf_zero; auto.
Qed.

Lemma C_symmetric a b : C a b = C b a.
Proof. unfold C, M. rewrite delta_sym. f_equal. apply sum_ext; intros; ring. Qed.

Lemma trace_C : sum (seq 0 6) (fun a => C a a) = 6 * q.
Proof.
  unfold C. rewrite (sum_ext _ _ (fun a => M a a + - t)) by (intros; rewrite delta_refl; ring).
  rewrite sum_add, sum_const, seq_length. unfold M. rewrite sum_swap.
  change (squared_norm n J + INR 6 * - t = 6 * q).
  assert (squared_norm n J = N * q) as -> by (pose proof N_large; unfold q; field; lra).
  pose proof t_of_q. simpl INR. lra.
Qed.

Lemma attained : exists s, optimally_failure_tolerant n J s.
Proof.
  destruct (positive_inverse 6 C C_symmetric C_positive) as [B [BS BI]].
  pose proof t_positive as Tp. pose proof q_positive as Qp. pose proof t_of_q as Tq. pose proof N_large as Nl.
  pose (x := fun f a => sum (seq 0 6) (fun b => B a b * J b f)).
  pose (beta := fun f => p f (x f)).
  assert (forall f a, (a < 6)%nat -> mv 6 C (x f) a = J a f) as Cx.
  { intros f a A. unfold mv, x.
    rewrite (sum_ext _ _ (fun b => sum (seq 0 6) (fun c => C a b * B b c * J c f)))
      by (intros; rewrite <- sum_scale; apply sum_ext; intros; ring).
    rewrite sum_swap, (seq_ext 6 _ (fun c => delta a c * J c f)).
    - apply (sum_delta 6 a (fun c => J c f) A).
    - intros c Lc. rewrite <- (BI a c A Lc).
      rewrite (sum_ext _ _ (fun b => J c f * (C a b * B b c))) by (intros; ring). rewrite sum_scale. ring. }
  assert (forall f, Qf (x f) = beta f) as Qx.
  { intros f. unfold Qf, beta, p, column, dot. apply seq_ext; intros a A. rewrite Cx by assumption. ring. }
  assert (forall f, (f < n)%nat -> beta f <= 1) as Beta.
  { intros f F. pose proof (leaves f (x f) F) as Lf. rewrite Qx in Lf. fold (beta f) in Lf.
    destruct (Rle_or_lt (beta f) 1) as [G|G]; [exact G|].
    assert (1 * beta f < beta f * beta f) by (apply Rmult_lt_compat_r; lra). lra. }
  assert (forall k, (k < 6)%nat -> sum (seq 0 6) (fun a => B a k * C a k) = 1) as BC.
  { intros k K. rewrite <- (delta_refl k), <- (BI k k K K). apply sum_ext; intros a _.
    rewrite (C_symmetric k a). ring. }
  assert (sum (seq 0 n) beta = 6 + t * sum (seq 0 6) (fun a => B a a)) as SumB.
  { unfold beta, p, column, dot, x.
    rewrite (sum_ext _ _ (fun f => sum (seq 0 6) (fun a => sum (seq 0 6) (fun b => J a f * (B a b * J b f)))))
      by (intros; apply sum_ext; intros; rewrite <- sum_scale; reflexivity).
    rewrite sum_swap, (seq_ext 6 _ (fun a => 1 + t * B a a)).
    - rewrite sum_add, sum_scale, sum_const, seq_length. simpl INR. ring.
    - intros a A. rewrite sum_swap.
      rewrite (sum_ext _ _ (fun b => B b a * C b a + t * (delta a b * B a b))).
      + rewrite sum_add, sum_scale, BC, (sum_delta 6 a (fun b => B a b) A) by assumption. ring.
      + intros b _. rewrite (sum_ext _ _ (fun f => B a b * (J a f * J b f))) by (intros; ring).
        rewrite sum_scale. fold (M a b). rewrite (BS b a), (C_symmetric b a). unfold C. ring. }
  assert (q * sum (seq 0 6) (fun a => B a a) <= 6) as TrB.
  { cut (t * sum (seq 0 6) (fun a => B a a) <= N - 6).
    { intros T. apply (Rmult_le_reg_r (N - 6)); [lra|].
      replace (q * sum (seq 0 6) (fun a => B a a) * (N - 6)) with (6 * (t * sum (seq 0 6) (fun a => B a a)));
        [lra|]. rewrite <- Rmult_assoc, Tq. ring. }
    cut (0 <= sum (seq 0 n) (fun f => 1 + (-1) * beta f)).
    - rewrite sum_add, sum_scale, sum_const, seq_length. change (sum (seq 0 n) (fun a => beta a)) with (sum (seq 0 n) beta).
      rewrite SumB. fold N. lra.
    - apply sum_nonneg. intros f F. apply in_seq in F. assert (f < n)%nat as G by lia. pose proof (Beta f G). lra. }
  pose (d := fun k a => B a k - delta a k / q).
  assert (forall k, (k < 6)%nat -> Qf (d k) = B k k - 2 / q + C k k / (q * q)) as Qd.
  { intros k K. unfold Qf, dot.
    rewrite (seq_ext 6 _ (fun a => (B a k * delta a k) + ((-1 / q) * (B a k * C a k)
       + ((-1 / q) * (delta a k * delta a k) + (1 / (q * q)) * (C a k * delta a k))))).
    - rewrite !sum_add, !sum_scale, BC, (sum_delta_r 6 k (fun a => B a k)), (sum_delta_r 6 k (fun a => C a k)),
        (sum_delta_r 6 k (fun a => delta a k)), delta_refl by assumption. field. lra.
    - intros a A. assert (mv 6 C (d k) a = delta a k - C a k / q) as ->.
      { unfold mv, d.
        rewrite (sum_ext _ _ (fun b => C a b * B b k + (-1 / q) * (C a b * delta b k))) by (intros; field; lra).
        rewrite sum_add, sum_scale, BI, (sum_delta_r 6 k (fun b => C a b)) by assumption. field. lra. }
      unfold d. field. lra. }
  assert (forall k, (k < 6)%nat -> Qf (d k) = 0) as Qd0.
  { intros k K. 
    assert (0 <= sum (seq 0 6) (fun k => Qf (d k))) as Nn by (apply sum_nonneg; intros; apply Qf_nonneg).
    apply (sum_zero_each (seq 0 6) (fun k => Qf (d k))); [intros; apply Qf_nonneg| |apply in_seq; lia].
    apply Rle_antisym; [|exact Nn].
    rewrite (seq_ext 6 _ (fun k => B k k + (- (2 / q) + 1 / (q * q) * C k k))).
    - rewrite !sum_add, sum_scale, trace_C, sum_const, seq_length. simpl INR.
      apply (Rmult_le_reg_l q); [exact Qp|]. rewrite Rmult_plus_distr_l.
      match goal with |- _ + ?e <= _ => assert (e = -6) as -> by (field; lra) end. lra.
    - intros l K'. rewrite Qd by assumption. field. lra. }
  assert (forall a k, (a < 6)%nat -> (k < 6)%nat -> B a k = delta a k / q) as Bval.
  { intros a k A K. pose proof (Qf_zero (d k) (Qd0 k K) a A) as E. unfold d in E. lra. }
  assert (forall a b, (a < 6)%nat -> (b < 6)%nat -> M a b = (t + q) * delta a b) as Iso.
  { intros a b A K. pose proof (BI a b A K) as E.
    rewrite (seq_ext 6 _ (fun k => 1 / q * (C a k * delta k b))) in E.
    - rewrite sum_scale, (sum_delta_r 6 b (fun k => C a k) K) in E. unfold C in E.
      assert (M a b - t * delta a b = q * (1 / q * (M a b - t * delta a b))) as F by (field; lra).
      rewrite E in F. lra.
    - intros k L. rewrite Bval by assumption. field. lra. }
  assert (forall f, (f < n)%nat -> sum (seq 0 6) (fun a => J a f * J a f) = q) as Eq.
  { intros f F. cut (q - sum (seq 0 6) (fun a => J a f * J a f) = 0); [lra|].
    apply (sum_zero_each (seq 0 n) (fun f => q - sum (seq 0 6) (fun a => J a f * J a f))).
    - intros g G. apply in_seq in G. assert (g < n)%nat as G' by lia. pose proof (Beta g G') as E.
      unfold beta, p, column, dot, x in E.
      rewrite (seq_ext 6 _ (fun a => 1 / q * (J a g * J a g))) in E.
      + rewrite sum_scale in E. cbv beta in *.
        cut (sum (seq 0 6) (fun a => J a g * J a g) <= q); [lra|].
        set (c := sum (seq 0 6) (fun a => J a g * J a g)) in *. clearbody c q.
        apply (Rmult_le_compat_l q) in E; [|lra].
        replace (q * (1 / q * c)) with c in E by (field; lra). lra.
      + intros a A. rewrite (seq_ext 6 _ (fun b => (delta a b * (J b g / q)))).
        * rewrite (sum_delta 6 a (fun b => J b g / q) A). field. lra.
        * intros b L. rewrite Bval by assumption. field. lra.
    - rewrite (sum_ext _ _ (fun f => q + (-1) * sum (seq 0 6) (fun a => J a f * J a f))) by (intros; ring).
      rewrite sum_add, !sum_scale, sum_const, seq_length.
      assert (sum (seq 0 n) (fun f => sum (seq 0 6) (fun a => J a f * J a f)) = N * q) as E by
        (unfold q; change (squared_norm n J = N * (squared_norm n J / N)); field; lra).
      cbv beta. rewrite E. fold N. ring.
    - apply in_seq. lia. }
  exists (t + q). split.
  - apply Iso.
  - intros i j I K. unfold dot, column. rewrite !Eq by assumption. reflexivity.
Qed.
End Attained.

(** The converse, and the bound itself *)

Lemma sum_without n f g : (f < n)%nat ->
  sum (seq 0 n) (fun i => if Nat.eqb i f then 0 else g i) = sum (seq 0 n) g - g f.
Proof.
  intros F. rewrite (sum_ext _ _ (fun i => g i + (-1) * (delta f i * g i))).
  - rewrite sum_add, sum_scale, (sum_delta n f g F). ring.
  - intros i _. unfold delta. rewrite Nat.eqb_sym. destruct (Nat.eqb f i); ring.
Qed.

Lemma dot_nonneg n x : 0 <= dot n x x.
Proof. apply sum_nonneg; intros; apply Rle_0_sqr. Qed.

Lemma cauchy_schwarz y x : 0 < dot 6 y y -> dot 6 y x * dot 6 y x <= dot 6 y y * dot 6 x x.
Proof.
  intros P. set (c := dot 6 y y) in *. set (b := dot 6 y x).
  apply (Rmult_le_reg_l c); [exact P|].
  pose proof (dot_nonneg 6 (fun a => c * x a - b * y a)) as G. unfold dot at 1 in G.
  rewrite (sum_ext _ _ (fun a => c * c * (x a * x a) + ((-2 * c * b) * (y a * x a) + b * b * (y a * y a))))
    in G by (intros; ring).
  rewrite !sum_add, !sum_scale in G. fold (dot 6 x x) (dot 6 y x) (dot 6 y y) in G. fold b c in G. lra.
Qed.

Section Optimal.
Variable n : nat.
Variable J : nat -> nat -> R.
Variable s : R.
Hypothesis redundant : (6 < n)%nat.
Hypothesis nonzero : 0 < squared_norm n J.
Hypothesis opt : optimally_failure_tolerant n J s.

Let c := dot 6 (column J 0) (column J 0).

Lemma equal_to_c i : (i < n)%nat -> dot 6 (column J i) (column J i) = c.
Proof. intros I. apply (equal_norms _ _ _ opt); lia. Qed.

Lemma squared_norm_c : squared_norm n J = INR n * c.
Proof.
  unfold squared_norm. rewrite (seq_ext n _ (fun _ => c)), sum_const, seq_length; [ring|].
  exact equal_to_c.
Qed.

Lemma squared_norm_s : squared_norm n J = 6 * s.
Proof.
  unfold squared_norm, dot, column. rewrite sum_swap, (seq_ext 6 _ (fun _ => s)), sum_const; [simpl; ring|].
  intros a A. rewrite (isotropic _ _ _ opt), delta_refl by assumption. ring.
Qed.

Lemma bound_value : 0 < INR n /\ 0 < c /\ 6 * s = INR n * c /\ bound n J = s - c.
Proof.
  assert (0 < INR n) as P by (apply lt_0_INR; lia).
  pose proof squared_norm_c as A. pose proof squared_norm_s as B.
  assert (0 < c) by (apply (Rmult_lt_reg_l (INR n)); lra).
  repeat split; try lra. unfold bound. rewrite A. replace s with (INR n * c / 6) by lra. field. lra.
Qed.

Lemma whole x :
  sum (seq 0 n) (fun i => dot 6 (column J i) x * dot 6 (column J i) x) = s * dot 6 x x.
Proof.
  unfold column, dot.
  rewrite (sum_mul_swap (seq 0 n) (seq 0 6) (seq 0 6) (fun a i => J a i * x a) (fun a i => J a i * x a)).
  rewrite <- sum_scale. apply seq_ext; intros a A.
  rewrite (seq_ext 6 _ (fun b => delta a b * (s * (x a * x b)))).
  - apply (sum_delta 6 a (fun b => s * (x a * x b)) A).
  - intros b B. rewrite (sum_ext _ _ (fun i => (x a * x b) * (J a i * J b i))) by (intros; ring).
    rewrite sum_scale, (isotropic _ _ _ opt) by assumption. ring.
Qed.

Lemma locked f x : (f < n)%nat ->
  sum (seq 0 n) (fun i => if Nat.eqb i f then 0 else dot 6 (column J i) x * dot 6 (column J i) x)
  = s * dot 6 x x - dot 6 (column J f) x * dot 6 (column J f) x.
Proof.
  intros F. rewrite (sum_without n f (fun i => dot 6 (column J i) x * dot 6 (column J i) x) F), whole.
  reflexivity.
Qed.

Lemma attains : worst_case_at_least n J (bound n J).
Proof.
  destruct bound_value as [_ [C [_ ->]]]. intros f x F. rewrite locked by assumption.
  pose proof (cauchy_schwarz (column J f) x) as S. rewrite (equal_to_c f F) in S. specialize (S C). lra.
Qed.

Lemma nothing_better t : worst_case_at_least n J t -> t <= bound n J.
Proof.
  destruct bound_value as [_ [C [_ ->]]]. intros T. assert (0 < n)%nat as O by lia.
  specialize (T 0%nat (column J 0) O). rewrite locked in T by assumption. fold c in T.
  apply (Rmult_le_reg_r c); lra.
Qed.
End Optimal.

Theorem attains_iff_optimal n J : (6 < n)%nat -> 0 < squared_norm n J ->
  worst_case_at_least n J (bound n J) <-> exists s, optimally_failure_tolerant n J s.
Proof.
  intros L P. split; [apply attained; assumption|]. intros [s O]. exact (attains n J s L P O).
Qed.

Theorem worst_case_bounded n J t : (6 < n)%nat -> 0 < squared_norm n J ->
  worst_case_at_least n J t -> t <= bound n J.
Proof.
  intros L P T. destruct (Rle_or_lt t (bound n J)) as [G|G]; [exact G|].
  assert (worst_case_at_least n J (bound n J)) as A.
  { intros f x F. eapply Rle_trans; [|exact (T f x F)].
    apply Rmult_le_compat_r; [apply dot_nonneg|lra]. }
  destruct (attained n J L P A) as [s O]. exact (nothing_better n J s L P O t T).
Qed.

Lemma revolute_nonzero n J : (0 < n)%nat -> revolute n J -> 0 < squared_norm n J.
Proof.
  intros P rev. apply Rlt_le_trans with (INR n); [apply lt_0_INR, P|].
  unfold squared_norm. cut (0 <= sum (seq 0 n) (fun i => dot 6 (column J i) (column J i) + - (1))).
  { rewrite sum_add, sum_const, seq_length. lra. }
  apply sum_nonneg. intros i I. apply in_seq in I. unfold dot, column.
  rewrite sum6, sum_add, (unit_axes _ _ rev i) by lia.
  assert (0 <= sum (seq 0 3) (fun a => J a i * J a i)); [|lra].
  apply sum_nonneg; intros; apply Rle_0_sqr.
Qed.
