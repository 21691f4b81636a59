(** Optimally failure-tolerant Jacobians of revolute joints exist for n = 6 and for all n >= 8:
    [exists_from_8]. Exact ones are given for n = 6, 8, 9, 10, 11 and 13; two Jacobians side by
    side are one, which gives all the others. *)
From Coq Require Import Reals List Lia Lra Arith.
From Lockedjoint Require Import Definitions Sums Reduction.
Import ListNotations.
Open Scope R_scope.

(** The columns (v; omega) are (e2; e1), (e3; e2), (e1; e3), and the same with -v. *)
Definition six (a i : nat) : R :=
  match i, a with
  | 0%nat, 1%nat | 1%nat, 2%nat | 2%nat, 0%nat => 1
  | 3%nat, 1%nat | 4%nat, 2%nat | 5%nat, 0%nat => -1
  | 0%nat, 3%nat | 1%nat, 4%nat | 2%nat, 5%nat | 3%nat, 3%nat | 4%nat, 4%nat | 5%nat, 5%nat => 1
  | _, _ => 0
  end.

Theorem six_optimal : revolute 6 six /\ optimally_failure_tolerant 6 six 2.
Proof.
  split; split.
  1-2: intros [|[|[|[|[|[|i]]]]]] I; try lia; simpl; ring.
  - intros [|[|[|[|[|[|a]]]]]] [|[|[|[|[|[|b]]]]]] A B; try lia; unfold delta; simpl; ring.
  - intros [|[|[|[|[|[|i]]]]]] [|[|[|[|[|[|j]]]]]] I K; try lia; unfold dot, column; simpl; ring.
Qed.

(** Two Jacobians side by side *)
Definition beside (n : nat) (J K : nat -> nat -> R) (a i : nat) : R :=
  if Nat.ltb i n then J a i else K a (i - n)%nat.

Lemma sum_beside n m f g :
  sum (seq 0 (n + m)) (fun i => if Nat.ltb i n then f i else g (i - n)%nat) = sum (seq 0 n) f + sum (seq 0 m) g.
Proof.
  induction m as [|m IH].
  - rewrite Nat.add_0_r. simpl. rewrite Rplus_0_r. apply seq_ext; intros i I.
    apply Nat.ltb_lt in I. rewrite I. reflexivity.
  - rewrite <- plus_n_Sm, !sum_S, IH. assert (Nat.ltb (n + m) n = false) as -> by (apply Nat.ltb_ge; lia).
    replace (n + m - n)%nat with m by lia. ring.
Qed.

Theorem beside_optimal n m J K s r : (0 < n)%nat -> (0 < m)%nat ->
  revolute n J -> optimally_failure_tolerant n J s ->
  revolute m K -> optimally_failure_tolerant m K r ->
  revolute (n + m) (beside n J K) /\ optimally_failure_tolerant (n + m) (beside n J K) (s + r).
Proof.
  intros N M RJ OJ RK OK. unfold beside. split; split.
  - intros i I. destruct (Nat.ltb_spec i n); [apply (unit_axes _ _ RJ)|apply (unit_axes _ _ RK)]; lia.
  - intros i I. destruct (Nat.ltb_spec i n); [apply (orthogonal _ _ RJ)|apply (orthogonal _ _ RK)]; lia.
  - intros a b A B.
    rewrite (sum_ext _ _ (fun i => if Nat.ltb i n then J a i * J b i else K a (i - n)%nat * K b (i - n)%nat))
      by (intros i _; destruct (Nat.ltb i n); reflexivity).
    rewrite (sum_beside n m (fun i => J a i * J b i) (fun i => K a i * K b i)),
      (isotropic _ _ _ OJ), (isotropic _ _ _ OK) by assumption. ring.
  - assert (forall i, (i < n + m)%nat ->
      dot 6 (column (fun a i => if Nat.ltb i n then J a i else K a (i - n)%nat) i)
            (column (fun a i => if Nat.ltb i n then J a i else K a (i - n)%nat) i) = 2) as E.
    { intros i I. unfold column. destruct (Nat.ltb_spec i n).
      - apply (column_norms n J s RJ OJ i); lia.
      - apply (column_norms m K r RK OK (i - n)); lia. }
    intros i j I L. rewrite !E by assumption. reflexivity.
Qed.

Theorem sum_exists n m : (0 < n)%nat -> (0 < m)%nat ->
  exists_optimal n -> exists_optimal m -> exists_optimal (n + m).
Proof.
  intros N M [J [s [RJ OJ]]] [K [r [RK OK]]]. exists (beside n J K), (s + r).
  apply beside_optimal; assumption.
Qed.

Theorem six_more n : (0 < n)%nat -> exists_optimal n -> exists_optimal (n + 6).
Proof.
  intros N E. apply sum_exists; [assumption|lia|assumption|]. exists six, 2. exact six_optimal.
Qed.

(** Exact Jacobians of 8, 9, 10, 11 and 13 joints (docs/existence.md). Joints are arranged in
    rings: (v; omega) and (v; -omega), each turned about the third axis by the angles of a
    regular polygon; for odd n also the ring of the (e3; omega), omega the corners of a triangle. *)

Record polygon (P : list (R * R)) : Prop := {
  corners : forall p, In p P -> fst p * fst p + snd p * snd p = 1;
  sum_cos : sum P fst = 0;
  sum_sin : sum P snd = 0;
  sum_cos2 : sum P (fun p => fst p * fst p) = INR (length P) / 2;
  sum_sin2 : sum P (fun p => snd p * snd p) = INR (length P) / 2;
  sum_cos_sin : sum P (fun p => fst p * snd p) = 0
}.

Lemma sum_affine P x y z u v w : polygon P ->
  sum P (fun p => (x + y * fst p + z * snd p) * (u + v * fst p + w * snd p))
  = INR (length P) * (x * u + (y * v + z * w) / 2).
Proof.
  intros [_ S0 S1 S2 S3 S4].
  rewrite (sum_ext _ _ (fun p => x * u + ((x * v + y * u) * fst p + ((x * w + z * u) * snd p
    + (y * v * (fst p * fst p) + (z * w * (snd p * snd p) + (y * w + z * v) * (fst p * snd p)))))))
    by (intros; ring).
  rewrite !sum_add, !sum_scale, sum_const.
  change (sum P (fun a => fst a)) with (sum P fst). change (sum P (fun a => snd a)) with (sum P snd).
  rewrite S0, S1, S2, S3, S4. field.
Qed.

(** A Jacobian from the list of its columns *)
Definition of_columns (l : list (nat -> R)) (a i : nat) : R := nth i l (fun _ => 0) a.

Lemma sum_of_columns l (f : (nat -> R) -> R) :
  sum (seq 0 (length l)) (fun i => f (nth i l (fun _ => 0))) = sum l f.
Proof.
  induction l as [|x l IH]; [reflexivity|]. cbn [length seq]. rewrite <- seq_shift.
  change (f x + sum (map S (seq 0 (length l))) (fun i => f (nth i (x :: l) (fun _ => 0))) = f x + sum l f).
  rewrite sum_map, <- IH. reflexivity.
Qed.

Lemma of_columns_optimal l s :
  (forall j, In j l -> j 3%nat * j 3%nat + j 4%nat * j 4%nat + j 5%nat * j 5%nat = 1
    /\ j 0%nat * j 0%nat + j 1%nat * j 1%nat + j 2%nat * j 2%nat = 1
    /\ j 0%nat * j 3%nat + j 1%nat * j 4%nat + j 2%nat * j 5%nat = 0) ->
  (forall a b, (a < 6)%nat -> (b < 6)%nat -> sum l (fun j => j a * j b) = s * delta a b) ->
  exists_optimal (length l).
Proof.
  intros L I. exists (of_columns l), s. unfold of_columns.
  assert (forall i, (i < length l)%nat -> In (nth i l (fun _ => 0)) l) as N by (intros; apply nth_In; assumption).
  split; split.
  - intros i K. destruct (L _ (N i K)) as [E _]. etransitivity; [|exact E]. simpl. ring.
  - intros i K. destruct (L _ (N i K)) as [_ [_ E]]. etransitivity; [|exact E]. simpl. ring.
  - intros a b A B. rewrite <- (I a b A B). apply (sum_of_columns l (fun j => j a * j b)).
  - assert (forall i, (i < length l)%nat -> dot 6 (column (fun a i => nth i l (fun _ => 0) a) i)
      (column (fun a i => nth i l (fun _ => 0) a) i) = 2) as E.
    { intros i K. destruct (L _ (N i K)) as [E [F _]]. unfold dot, column. simpl. lra. }
    intros i j K M. rewrite !E by assumption. reflexivity.
Qed.

Section Rings.
Variables a b h : R.
Hypothesis hh : 2 * (h * h) = 1.
Hypothesis ab : a * a + 2 * (b * b) = 1.

Definition ring_column (e : R) (p : R * R) (k : nat) : R :=
  match k with
  | O => 0 + 2 * h * b * fst p + 0 * snd p
  | S O => 0 + 0 * fst p + 2 * h * b * snd p
  | S (S O) => a + 0 * fst p + 0 * snd p
  | S (S (S O)) => 0 + e * - (a * h) * fst p + e * - h * snd p
  | S (S (S (S O))) => 0 + e * h * fst p + e * - (a * h) * snd p
  | _ => e * b + 0 * fst p + 0 * snd p
  end.

Lemma ring_revolute e p : e * e = 1 -> fst p * fst p + snd p * snd p = 1 ->
  let j := ring_column e p in
  j 3%nat * j 3%nat + j 4%nat * j 4%nat + j 5%nat * j 5%nat = 1
    /\ j 0%nat * j 0%nat + j 1%nat * j 1%nat + j 2%nat * j 2%nat = 1
    /\ j 0%nat * j 3%nat + j 1%nat * j 4%nat + j 2%nat * j 5%nat = 0.
Proof.
  intros E U. destruct p as [c s]. simpl in *. repeat split.
  - transitivity ((e * e) * ((h * h) * (a * a + 1) * (c * c + s * s) + b * b)); [ring|]. rewrite E, U. nra.
  - transitivity (4 * (h * h) * (b * b) * (c * c + s * s) + a * a); [ring|]. rewrite U. nra.
  - transitivity (e * (a * b) * (1 - 2 * (h * h) * (c * c + s * s))); [ring|]. rewrite U, Rmult_1_r, hh. ring.
Qed.

Definition two_rings P := map (ring_column 1) P ++ map (ring_column (-1)) P.

Lemma two_rings_isotropic P k l : polygon P -> (k < 6)%nat -> (l < 6)%nat ->
  sum (two_rings P) (fun j => j k * j l)
  = INR (length P) * (delta k l * match k with
    2%nat => 2 * (a * a) | 3%nat | 4%nat => (a * a + 1) / 2 | _ => 2 * (b * b) end).
Proof.
  intros H K L. unfold two_rings. rewrite sum_app, !sum_map.
  destruct k as [|[|[|[|[|[|k]]]]]]; try lia; destruct l as [|[|[|[|[|[|l]]]]]]; try lia;
    cbn [ring_column]; rewrite !(sum_affine P) by assumption; unfold delta; cbn [Nat.eqb];
    rewrite <- Rmult_plus_distr_l; f_equal; nra.
Qed.
End Rings.

Lemma in_two_rings a b h P j : In j (two_rings a b h P) ->
  exists e p, e * e = 1 /\ In p P /\ j = ring_column a b h e p.
Proof.
  intros I. apply in_app_or in I as [I|I]; apply in_map_iff in I as [p [<- I]].
  - exists 1, p. repeat split; [ring|exact I].
  - exists (-1), p. repeat split; [ring|exact I].
Qed.

Lemma length_two_rings a b h P : length (two_rings a b h P) = (2 * length P)%nat.
Proof. unfold two_rings. rewrite app_length, !map_length. lia. Qed.

Lemma root x : 0 <= x -> exists r, r * r = x.
Proof. intros X. exists (sqrt x). apply sqrt_sqrt, X. Qed.

Theorem even_exists P : polygon P -> exists_optimal (2 * length P).
Proof.
  intros H. destruct (root (1 / 3)) as [a A]; [lra|]. destruct (root (1 / 2)) as [h S]; [lra|].
  rewrite <- (length_two_rings a a h P). apply of_columns_optimal with (s := 2 / 3 * INR (length P)).
  - intros j I. apply in_two_rings in I as [e [p [E [I ->]]]].
    apply ring_revolute; [lra|lra|exact E|exact (corners _ H p I)].
  - intros k l K L. rewrite two_rings_isotropic by (assumption || lra).
    destruct k as [|[|[|[|[|[|k]]]]]]; try lia; rewrite ?A; field.
Qed.

Definition axial_column (p : R * R) (k : nat) : R :=
  match k with
  | 2%nat => 1 + 0 * fst p + 0 * snd p
  | 3%nat => 0 + 1 * fst p + 0 * snd p
  | 4%nat => 0 + 0 * fst p + 1 * snd p
  | _ => 0 + 0 * fst p + 0 * snd p
  end.

Theorem odd_exists P T : polygon P -> polygon T -> length T = 3%nat -> (3 <= length P)%nat ->
  exists_optimal (2 * length P + 3).
Proof.
  intros H G T3 M. set (m := INR (length P)).
  assert (3 <= m) as M3 by (replace 3 with (INR 3) by (simpl; ring); apply le_INR, M).
  assert (0 < / (6 * m)) as Q by (apply Rinv_0_lt_compat; lra).
  destruct (root ((2 * m - 6) / (6 * m))) as [a A]; [apply Rmult_le_pos; lra|].
  destruct (root ((2 * m + 3) / (6 * m))) as [b B]; [apply Rmult_le_pos; lra|].
  destruct (root (1 / 2)) as [h S]; [lra|].
  assert (a * a + 2 * (b * b) = 1) as AB by (rewrite A, B; field; lra).
  assert (length (two_rings a b h P ++ map axial_column T) = 2 * length P + 3)%nat as <-.
  { rewrite app_length, length_two_rings, map_length, T3. reflexivity. }
  apply of_columns_optimal with (s := (2 * m + 3) / 3).
  - intros j I. apply in_app_or in I as [I|I].
    + apply in_two_rings in I as [e [p [E [I ->]]]].
      apply ring_revolute; [lra|exact AB|exact E|exact (corners _ H p I)].
    + apply in_map_iff in I as [p [<- I]]. pose proof (corners _ G p I) as U. simpl.
      repeat split; lra.
  - intros k l K L. rewrite sum_app, sum_map, two_rings_isotropic by (assumption || lra). fold m.
    destruct k as [|[|[|[|[|[|k]]]]]]; try lia; destruct l as [|[|[|[|[|[|l]]]]]]; try lia;
      cbn [axial_column]; rewrite (sum_affine T), T3 by assumption;
      unfold delta; cbn [Nat.eqb]; rewrite ?A, ?B; simpl INR; field; lra.
Qed.

(** Regular polygons with three, four and five corners *)

Lemma triangle : exists P, polygon P /\ length P = 3%nat.
Proof.
  destruct (root (3 / 4)) as [s S]; [lra|]. exists [(1, 0); (- (1 / 2), s); (- (1 / 2), - s)].
  split; [split|reflexivity]; cbn; try lra.
  intros p [<-|[<-|[<-|[]]]]; cbn; lra.
Qed.

Lemma square : exists P, polygon P /\ length P = 4%nat.
Proof.
  exists [(1, 0); (0, 1); (-1, 0); (0, -1)].
  split; [split|reflexivity]; cbn; try lra.
  intros p [<-|[<-|[<-|[<-|[]]]]]; cbn; lra.
Qed.

Lemma pentagon : exists P, polygon P /\ length P = 5%nat.
Proof.
  assert (0 <= 5) as N by lra. pose (q := sqrt 5).
  assert (q * q = 5) as Q by (apply sqrt_sqrt, N). assert (0 <= q) as Q0 by apply sqrt_pos.
  pose (c := (q - 1) / 4). pose (d := (- q - 1) / 4).
  destruct (root ((5 + q) / 8)) as [s S]; [lra|]. pose (t := 2 * s * c).
  assert (c * c = (3 - q) / 8) as CC by (unfold c; nra).
  assert (d * d = (3 + q) / 8) as DD by (unfold d; nra).
  assert (t * t = (5 - q) / 8) as TT.
  { unfold t. transitivity (4 * (s * s) * (c * c)); [ring|]. rewrite S, CC. nra. }
  assert (c + d = - (1 / 2)) as CD by (unfold c, d; lra).
  exists [(1, 0); (c, s); (d, t); (d, - t); (c, - s)].
  split; [split|reflexivity]; cbn; try lra.
  intros p [<-|[<-|[<-|[<-|[<-|[]]]]]]; cbn; lra.
Qed.

Theorem exists_from_8 n : (8 <= n)%nat -> exists_optimal n.
Proof.
  destruct triangle as [T [HT LT]], square as [Q [HQ LQ]], pentagon as [F [HF LF]].
  pose proof (even_exists Q HQ) as E8. rewrite LQ in E8. pose proof (even_exists F HF) as E10.
  rewrite LF in E10. assert (3 <= 4)%nat as L4 by lia. assert (3 <= 5)%nat as L5 by lia.
  assert (3 <= 3)%nat as L3 by lia.
  pose proof (odd_exists T T HT HT LT) as E9. rewrite LT in E9. specialize (E9 L3).
  pose proof (odd_exists Q T HQ HT LT) as E11. rewrite LQ in E11. specialize (E11 L4).
  pose proof (odd_exists F T HF HT LT) as E13. rewrite LF in E13. specialize (E13 L5).
  induction n as [n IH] using lt_wf_ind. intros N.
  destruct (Nat.lt_ge_cases n 14) as [S|S].
  - assert (exists_optimal 6) as E6 by (exists six, 2; exact six_optimal).
    do 8 (destruct n as [|n]; [lia|]). destruct n as [|[|[|[|[|[|n]]]]]]; try lia; try assumption.
    apply (six_more 6); [lia|exact E6].
  - replace n with (n - 6 + 6)%nat by lia. apply six_more; [lia|]. apply IH; lia.
Qed.

(** Seven joints can be revolute: the hypothesis of the theorem of nonexistence can be met. *)
Lemma seven_revolute : exists J, revolute 7 J.
Proof.
  exists (fun a _ => if Nat.eqb a 0 then 1 else if Nat.eqb a 4 then 1 else 0).
  split; intros i _; simpl; lra.
Qed.
